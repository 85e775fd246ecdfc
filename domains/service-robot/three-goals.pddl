; 8 items on 10 pieces of furniture; made by generate.py.
(define (problem three-goals)
  (:domain service-robot)
  (:objects
    table1 - surface
    fridge2 - container
    shelf3 - surface
    cupboard4 - container
    counter5 - surface
    drawer6 - container
    desk7 - surface
    wardrobe8 - container
    radio9 - appliance
    windowsill10 - surface
    cup1 plate2 book3 bottle4 apple5 towel6 phone7 box8 - item)
  (:init
    (near table1) (hand_free)
    (has_door fridge2)
    (has_door cupboard4)
    (has_door drawer6)
    (has_door wardrobe8)
    (fits cup1 table1)
    (fits cup1 wardrobe8)
    (fits cup1 drawer6)
    (fits cup1 cupboard4)
    (at cup1 table1)
    (fits plate2 fridge2)
    (fits plate2 windowsill10)
    (fits plate2 desk7)
    (fits plate2 counter5)
    (at plate2 fridge2)
    (fits book3 shelf3)
    (fits book3 table1)
    (fits book3 wardrobe8)
    (fits book3 drawer6)
    (at book3 shelf3)
    (fits bottle4 cupboard4)
    (fits bottle4 fridge2)
    (fits bottle4 windowsill10)
    (fits bottle4 desk7)
    (unknown (at bottle4 cupboard4))
    (unknown (at bottle4 fridge2))
    (unknown (at bottle4 windowsill10))
    (fits apple5 counter5)
    (fits apple5 shelf3)
    (fits apple5 table1)
    (fits apple5 wardrobe8)
    (at apple5 counter5)
    (fits towel6 drawer6)
    (fits towel6 cupboard4)
    (fits towel6 fridge2)
    (fits towel6 windowsill10)
    (at towel6 drawer6)
    (fits phone7 desk7)
    (fits phone7 counter5)
    (fits phone7 shelf3)
    (fits phone7 table1)
    (at phone7 desk7)
    (fits box8 wardrobe8)
    (fits box8 drawer6)
    (fits box8 cupboard4)
    (fits box8 fridge2)
    (at box8 wardrobe8))
  (:goal (and (at cup1 cupboard4) (at bottle4 desk7) (switched_on radio9)))
  (:goal-probability 0.9))
