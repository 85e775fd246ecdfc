; The battery does not last for the way there: the robot charges first, which takes a minute.
(define (problem nearly-empty)
  (:domain building)
  (:objects charger lobby office - place)
  (:init
    (at lobby)
    (way charger lobby) (way lobby charger)
    (way lobby office) (way office lobby)
    (busy lobby) (busy office)
    (dock charger) (post lobby) (desk office)
    (= (battery) 1))
  (:goal (and (delivered) (>= (battery) 2)))
  (:goal-probability 0.9))
