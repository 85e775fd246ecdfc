(define (domain d) (:predicates (p)) (:action a :precondition (and and (p))))
