; Each valve opens once the other is open; a kick alone, which often does nothing, breaks the circle.
(define (domain valves)
  (:predicates (open-inner) (open-outer))
  (:action turn-inner
    :precondition (and (open-outer) (not (open-inner)))
    :effect (open-inner))
  (:action turn-outer
    :precondition (and (open-inner) (not (open-outer)))
    :effect (open-outer))
  (:action kick-outer
    :precondition (not (open-outer))
    :effect (probabilistic 1/2 (open-outer))))
(define (problem drain) (:domain valves)
  (:init)
  (:goal (open-inner))
  (:goal-probability 0.99))
