; A hospital robot pushes a trolley of meal trays. On every push each tray may slip on its own: one
; action with independent chance effects, one factor per tray.
(define (domain trolley)
  (:requirements :typing :negative-preconditions :conditional-effects :universal-effects
                 :universal-preconditions :probabilistic-effects)
  (:types place tray)

  (:predicates
    (trolley_at ?place - place)
    (on ?tray - tray)
    (strapped ?tray - tray)
    (spilled ?tray - tray)
    (spare_meals))

  ; A loose tray slips one time in ten, and one slipped tray in four spills.
  (:action push
    :parameters (?to - place)
    :precondition (not (trolley_at ?to))
    :effect (and
      (forall (?place - place) (not (trolley_at ?place)))
      (trolley_at ?to)
      (forall (?tray - tray)
        (when (and (on ?tray) (not (strapped ?tray)))
          (probabilistic 1/10 (and (not (on ?tray)) (probabilistic 1/4 (spilled ?tray))))))))

  (:action strap
    :parameters (?tray - tray)
    :precondition (on ?tray)
    :effect (probabilistic 0.9 (strapped ?tray)))

  (:action put_back
    :parameters (?tray - tray)
    :precondition (and (not (on ?tray)) (not (spilled ?tray)))
    :effect (probabilistic 0.8 (on ?tray)))

  ; Fill a spilled tray again from the spares; without spares a spilled tray is lost.
  (:action refill
    :parameters (?tray - tray)
    :precondition (and (spilled ?tray) (spare_meals))
    :effect (not (spilled ?tray))))
