; A robot in an office building, where doors may stand open or shut. Nobody can open one for it. It sees whether
; a door is open when it stands before it; from further away it may listen for a draught, once for each door.
(define (domain corridors)
  (:requirements :typing :negative-preconditions :action-costs :probabilistic-effects :contingent)
  (:types place door)

  (:predicates
    (robot-at ?place - place)
    (joins ?door - door ?from ?to - place)
    (open ?door - door)         ; hidden
    (audible ?door - door ?place - place)
    (heard ?door - door))

  (:functions (total-cost) (length ?door - door)) ; of the way to the door and through it

  (:action peek
    :parameters (?door - door ?from ?to - place)
    :precondition (and (robot-at ?from) (joins ?door ?from ?to))
    :effect (increase (total-cost) 1)
    :observe (open ?door))

  (:action listen
    :parameters (?door - door ?place - place)
    :precondition (and (robot-at ?place) (audible ?door ?place) (not (heard ?door)))
    :effect (and (heard ?door) (increase (total-cost) 1))
    :observe (probabilistic 0.8 (open ?door)))

  (:action pass
    :parameters (?door - door ?from ?to - place)
    :precondition (and (robot-at ?from) (joins ?door ?from ?to) (open ?door))
    :effect (and
      (not (robot-at ?from))
      (robot-at ?to)
      (increase (total-cost) (length ?door)))))
