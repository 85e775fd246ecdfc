; Insulin for the children's ward, one floor up; both doors on the way are shut.
(define (problem one-box)
  (:domain hospital)
  (:objects
    pharmacy hall landing - room
    children - ward
    pharmacy_door children_door - door
    olga - nurse
    insulin - box)
  (:init
    (at hall)
    (dock hall)
    (dock landing)
    (lift_stop hall)
    (lift_stop landing)
    (lift_works)
    (lift_at hall)
    (joins pharmacy_door hall pharmacy)
    (joins children_door landing children)
    (unknown (bolted pharmacy_door))
    (unknown (bolted children_door))
    (works_on olga children)
    (unknown (present olga))
    (ordered_by insulin olga)
    (lies_in insulin pharmacy))
  (:goal (given insulin))
  (:goal-probability 0.99)
  (:metric minimize (total-cost)))
