; A courier in an office building. Doors may be closed; a letter may fall while it is carried.
(define (domain courier)
  (:requirements :typing :negative-preconditions :universal-effects :probabilistic-effects :unknown)
  (:types room letter)

  (:predicates
    (at ?room - room)
    (open ?room - room)           ; its door; unknown until looked at
    (has ?letter - letter)
    (delivered ?letter - letter)
    (for ?letter - letter ?room - room))

  (:action look-at-door
    :parameters (?room - room)
    :precondition (unknown (open ?room))
    :effect (probabilistic
      3/4 (open ?room)
      1/4 (not (open ?room))))

  (:action ask-to-open
    :parameters (?room - room)
    :precondition (not (open ?room))
    :effect (probabilistic 0.8 (open ?room)))

  (:action go
    :parameters (?room - room)
    :precondition (and (open ?room) (not (at ?room)))
    :effect (and (forall (?other - room) (not (at ?other))) (at ?room)))

  (:action hand-over
    :parameters (?letter - letter ?room - room)
    :precondition (and (has ?letter) (for ?letter ?room) (at ?room))
    :effect (delivered ?letter)))
