; 3 items on 6 pieces of furniture; made by generate.py.
(define (problem two-goals)
  (:domain service-robot)
  (:objects
    table1 - surface
    fridge2 - container
    shelf3 - surface
    cupboard4 - container
    counter5 - surface
    drawer6 - container
    cup1 plate2 book3 - item)
  (:init
    (near table1) (hand_free)
    (has_door fridge2)
    (has_door cupboard4)
    (has_door drawer6)
    (fits cup1 table1)
    (fits cup1 fridge2)
    (fits cup1 shelf3)
    (fits cup1 cupboard4)
    (at cup1 table1)
    (fits plate2 fridge2)
    (fits plate2 shelf3)
    (fits plate2 cupboard4)
    (fits plate2 counter5)
    (at plate2 fridge2)
    (fits book3 shelf3)
    (fits book3 cupboard4)
    (fits book3 counter5)
    (fits book3 drawer6)
    (unknown (at book3 shelf3))
    (unknown (at book3 cupboard4))
    (unknown (at book3 counter5)))
  (:goal (and (at cup1 cupboard4) (at book3 drawer6)))
  (:goal-probability 0.95))
