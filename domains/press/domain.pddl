; A part lies under a press, perhaps upside down. Pressed upside down, it is spoilt. A camera tells how it
; lies; without light, there is a balance that feels the difference, and is wrong now and then.
(define (domain press)
  (:requirements :typing :negative-preconditions :conditional-effects :probabilistic-effects
                 :contingent)
  (:types part)

  (:predicates
    (upside-down ?part - part)  ; hidden
    (lit)
    (pressed ?part - part)
    (spoilt ?part - part))

  (:action look
    :parameters (?part - part)
    :precondition (and (lit) (unknown (upside-down ?part)))
    :observe (upside-down ?part))

  (:action weigh
    :parameters (?part - part)
    :precondition (and (not (lit)) (unknown (upside-down ?part)))
    :observe (probabilistic 0.85 (upside-down ?part)))

  (:action turn
    :parameters (?part - part)
    :precondition (not (pressed ?part))
    :effect (and
      (when (upside-down ?part) (not (upside-down ?part)))
      (when (not (upside-down ?part)) (upside-down ?part))))

  (:action press
    :parameters (?part - part)
    :precondition (not (pressed ?part))
    :effect (and (pressed ?part) (when (upside-down ?part) (spoilt ?part)))
    :observe (spoilt ?part)))
