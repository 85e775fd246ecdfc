; On one floor: a door that people use, and a corridor that they crowd.
(define (problem along-the-corridor)
  (:domain building)
  (:objects
    charger corridor office - place
    swing-door - door)
  (:init
    (at charger)
    (doorway swing-door charger corridor) (doorway swing-door corridor charger)
    (way corridor office) (way office corridor)
    (busy corridor)
    (dock charger) (post charger) (desk office)
    (= (battery) 5))
  (:goal (and (delivered) (at charger)))
  (:goal-probability 0.9))
