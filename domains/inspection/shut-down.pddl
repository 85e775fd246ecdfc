; Every valve must be closed, and seen to be; the lens got dirty on the way.
(define (problem shut-down)
  (:domain inspection)
  (:objects
    cellar - area
    drain - valve)
  (:init (at pump_hall) (located drain cellar) (unknown (closed drain)))
  (:goal (closed drain))
  (:goal-probability 0.95)
  (:metric minimize (total-cost)))
