; A robot looks for a tin that stands on one of several shelves. A sharp camera tells whether it is there; a
; blurred one is wrong now and then. A hand that closes on nothing knocks the shelf over, and that is that.
(define (domain shelves)
  (:requirements :typing :negative-preconditions :equality :conditional-effects
                 :probabilistic-effects :contingent)
  (:types shelf)

  (:predicates
    (robot-at ?shelf - shelf)
    (tin-at ?shelf - shelf)     ; hidden
    (sharp)                     ; the camera is
    (holding)
    (spilt))

  (:action drive
    :parameters (?from ?to - shelf)
    :precondition (and (robot-at ?from) (not (= ?from ?to)))
    :effect (and (not (robot-at ?from)) (robot-at ?to)))

  (:action look
    :parameters (?shelf - shelf)
    :precondition (and (sharp) (robot-at ?shelf) (unknown (tin-at ?shelf)))
    :observe (tin-at ?shelf))

  (:action glance
    :parameters (?shelf - shelf)
    :precondition (and (not (sharp)) (robot-at ?shelf) (unknown (tin-at ?shelf)))
    :observe (probabilistic 0.85 (tin-at ?shelf)))

  (:action grasp
    :parameters (?shelf - shelf)
    :precondition (and (robot-at ?shelf) (not (holding)) (not (spilt)))
    :effect (and (when (tin-at ?shelf) (holding)) (when (not (tin-at ?shelf)) (spilt)))
    :observe (holding)))
