; One match, and it burns every second time: no tree does better.
(define (domain stove)
  (:predicates (lit) (match))
  (:action strike
    :precondition (and (match) (not (lit)))
    :effect (probabilistic 1/2 (and (lit) (not (match))) 1/2 (not (match)))))
(define (problem light-it) (:domain stove)
  (:init (match))
  (:goal (lit))
  (:goal-probability 1/2))
