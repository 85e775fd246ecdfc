; One gauge, in the dark and with a dirty lens. Any reading will do.
(define (problem read-the-gauge)
  (:domain inspection)
  (:objects
    boiler_room - area
    pressure - gauge
    feed - valve)
  (:init
    (at pump_hall)
    (located pressure boiler_room)
    (located feed boiler_room)
    (unknown (closed feed))
    (unknown (in_range pressure)))
  (:goal (and (known (in_range pressure)) (at pump_hall)))
  (:goal-probability 1)
  (:metric minimize (total-cost)))
