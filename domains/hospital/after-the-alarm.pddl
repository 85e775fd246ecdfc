; A fire alarm has stopped the lift and bolted the ward's door. The robot stands upstairs with a low battery; the
; box fell down in the hall.
(define (problem after-the-alarm)
  (:domain hospital)
  (:objects
    hall landing - room
    children - ward
    children_door - door
    olga - nurse
    insulin - box)
  (:init
    (at landing)
    (battery_low)
    (dock hall)
    (dock landing)
    (lift_stop hall)
    (lift_stop landing)
    (lift_at hall)
    (joins children_door landing children)
    (bolted children_door)
    (works_on olga children)
    (not (present olga))
    (ordered_by insulin olga)
    (lies_in insulin hall))
  (:goal (given insulin))
  (:goal-probability 0.99)
  (:metric minimize (total-cost)))
