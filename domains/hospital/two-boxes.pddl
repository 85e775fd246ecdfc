; Two boxes from the hall: one for the surgical ward on the same floor, one for the children's ward upstairs.
(define (problem two-boxes)
  (:domain hospital)
  (:objects
    hall landing - room
    children surgery - ward
    children_door surgery_door - door
    olga pavel - nurse
    insulin saline - box)
  (:init
    (at hall)
    (dock hall)
    (dock landing)
    (lift_stop hall)
    (lift_stop landing)
    (lift_works)
    (lift_at landing)
    (joins surgery_door hall surgery)
    (joins children_door landing children)
    (unknown (bolted surgery_door))
    (unknown (bolted children_door))
    (works_on olga children)
    (works_on pavel surgery)
    (unknown (present olga))
    (unknown (present pavel))
    (ordered_by insulin olga)
    (ordered_by saline pavel)
    (lies_in insulin hall)
    (lies_in saline hall))
  (:goal (and (given insulin) (given saline)))
  (:goal-probability 0.99)
  (:metric minimize (total-cost)))
