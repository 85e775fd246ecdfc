; Two trays, one of them strapped already, and spares for what spills.
(define (problem with-spares)
  (:domain trolley)
  (:objects
    kitchen ward - place
    tray1 tray2 - tray)
  (:init (trolley_at kitchen) (on tray1) (on tray2) (strapped tray1) (spare_meals))
  (:goal (and (trolley_at ward) (forall (?tray - tray) (on ?tray))))
  (:goal-probability 0.99))
