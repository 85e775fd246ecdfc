; Three loose trays to the ward.
(define (problem three-trays)
  (:domain trolley)
  (:objects
    kitchen ward - place
    tray1 tray2 tray3 - tray)
  (:init (trolley_at kitchen) (on tray1) (on tray2) (on tray3))
  (:goal (and (trolley_at ward) (forall (?tray - tray) (on ?tray))))
  (:goal-probability 0.95))
