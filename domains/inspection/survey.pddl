; Find out about every valve, whatever its state; the lens is dirty, and the lamps of
; the cellar are off.
(define (problem survey)
  (:domain inspection)
  (:objects
    cellar - area
    inlet drain - valve)
  (:init
    (at pump_hall)
    (lit pump_hall)
    (located inlet pump_hall)
    (located drain cellar)
    (unknown (closed inlet))
    (unknown (closed drain)))
  (:goal (forall (?valve - valve) (known (closed ?valve))))
  (:goal-probability 0.95)
  (:metric minimize (total-cost)))
