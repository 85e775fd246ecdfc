(define (domain d) (:predicates (p)) (:action a :precondition (and not (p)) :effect (oneof imply (p))))
