(define (domain d) (:predicates (p)) (:action a :effect (and (p) (decrease (reward) and))))
