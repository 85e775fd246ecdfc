; From the dock through the glass door and the lobby, with the lift, to an office upstairs.
(define (problem letter-upstairs)
  (:domain building)
  (:objects
    charger lobby downstairs upstairs office - place
    glass-door - door)
  (:init
    (at charger)
    (way charger lobby) (way lobby charger)
    (doorway glass-door lobby downstairs) (doorway glass-door downstairs lobby)
    (landing downstairs) (landing upstairs)
    (way upstairs office) (way office upstairs)
    (busy lobby)
    (dock charger) (post lobby) (desk office)
    (= (battery) 6))
  (:goal (delivered))
  (:goal-probability 0.95))
