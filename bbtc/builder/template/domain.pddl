; A robot waters plants. It cannot see whether the soil is moist until it has measured.
(define (domain greenhouse)
  (:requirements :typing :negative-preconditions :universal-effects :probabilistic-effects :unknown)
  (:types plant)

  (:predicates
    (at ?plant - plant)
    (moist ?plant - plant))       ; unknown until measured

  (:action go
    :parameters (?plant - plant)
    :precondition (not (at ?plant))
    :effect (and (forall (?other - plant) (not (at ?other))) (at ?plant)))

  (:action measure
    :parameters (?plant - plant)
    :precondition (and (at ?plant) (unknown (moist ?plant)))
    :effect (probabilistic
      1/2 (moist ?plant)
      1/2 (not (moist ?plant))))

  ; The valve sticks at times.
  (:action water
    :parameters (?plant - plant)
    :precondition (and (at ?plant) (not (moist ?plant)))
    :effect (probabilistic 0.9 (moist ?plant))))
