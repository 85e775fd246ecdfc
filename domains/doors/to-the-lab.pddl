; Two doors in a row, and no key for either: the control room has to open what is locked.
(define (problem to-the-lab)
  (:domain doors)
  (:objects
    hall corridor lab - room
    corridor_door lab_door - door)
  (:init
    (in hall)
    (joins corridor_door hall corridor)
    (joins lab_door corridor lab)
    (unknown (locked corridor_door))
    (unknown (locked lab_door)))
  (:goal (in lab))
  (:goal-probability 0.8))
