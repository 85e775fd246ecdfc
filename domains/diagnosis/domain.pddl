; A robot arm stands still, and one of its parts is to blame. Tests cost time, spare parts cost money. A good
; meter tells whether a part is faulty; an old one may be wrong, and tells the same if asked again.
(define (domain diagnosis)
  (:requirements :typing :negative-preconditions :existential-preconditions :universal-preconditions
                 :action-costs :probabilistic-effects :contingent)
  (:types part)

  (:predicates
    (faulty ?part - part)       ; hidden
    (good-meter)
    (measured ?part - part))

  (:functions (total-cost) (price ?part - part))

  (:action measure
    :parameters (?part - part)
    :precondition (and (good-meter) (unknown (faulty ?part)))
    :effect (increase (total-cost) 2)
    :observe (faulty ?part))

  (:action estimate
    :parameters (?part - part)
    :precondition (and (not (good-meter)) (not (measured ?part)))
    :effect (and (measured ?part) (increase (total-cost) 1))
    :observe (probabilistic 0.85 (faulty ?part)))

  (:action swap
    :parameters (?part - part)
    :effect (and (not (faulty ?part)) (increase (total-cost) (price ?part))))

  (:action switch-on
    :effect (increase (total-cost) 3)
    :observe (exists (?part - part) (faulty ?part))))
