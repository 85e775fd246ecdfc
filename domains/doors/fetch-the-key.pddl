; The lab is locked, and its key hangs in the office on the other side of the hall.
(define (problem fetch-the-key)
  (:domain doors)
  (:objects
    office hall lab - room
    office_door lab_door - door
    lab_key - key)
  (:init
    (in hall)
    (joins office_door hall office)
    (joins lab_door hall lab)
    (fits lab_key lab_door)
    (hangs_in lab_key office)
    (unknown (locked office_door))
    (locked lab_door))
  (:goal (in lab))
  (:goal-probability 0.9))
