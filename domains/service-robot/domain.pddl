; A service robot with one arm tidies a flat: it walks to a piece of furniture, opens it if it has a
; door, picks an item up there, places it elsewhere, and switches appliances on. Everything may fail,
; and where an item is may be unknown until the robot has looked.
(define (domain service-robot)
  (:requirements :typing :negative-preconditions :universal-effects :disjunctive-preconditions
                 :equality :conditional-effects :probabilistic-effects :unknown)
  (:types
    surface container appliance - furniture
    item furniture)

  (:predicates
    (near ?spot - furniture)
    (fits ?item - item ?spot - furniture)      ; where an item may stand: the problem says it once
    (has_door ?spot - furniture)
    (open ?spot - furniture)
    (unknown (at ?item - item ?spot - furniture))
    (hand_free)
    (holding ?item - item)
    (switched_on ?device - appliance))

  ; Somebody in the way stops one walk in fifty.
  (:action walk
    :parameters (?to - furniture)
    :precondition (not (near ?to))
    :effect (probabilistic
      0.98 (and
        (near ?to)
        (forall (?other - furniture) (when (not (= ?other ?to)) (not (near ?other)))))))

  (:action open
    :parameters (?spot - container)
    :precondition (and (near ?spot) (has_door ?spot) (not (open ?spot)) (hand_free))
    :effect (probabilistic 0.95 (open ?spot)))

  (:action look_for
    :parameters (?item - item ?spot - furniture)
    :precondition (and
      (near ?spot)
      (fits ?item ?spot)
      (unknown (at ?item ?spot))
      (or (not (has_door ?spot)) (open ?spot)))
    :effect (probabilistic
      3/4 (at ?item ?spot)
      1/4 (not (at ?item ?spot))))

  (:action pick
    :parameters (?item - item ?spot - furniture)
    :precondition (and
      (near ?spot)
      (fits ?item ?spot)
      (at ?item ?spot)
      (hand_free)
      (or (not (has_door ?spot)) (open ?spot)))
    :effect (probabilistic
      0.9 (and (holding ?item) (not (hand_free)) (not (at ?item ?spot)))))

  (:action place
    :parameters (?item - item ?spot - furniture)
    :precondition (and
      (near ?spot)
      (fits ?item ?spot)
      (holding ?item)
      (or (not (has_door ?spot)) (open ?spot)))
    :effect (probabilistic 0.95 (and (at ?item ?spot) (hand_free) (not (holding ?item)))))

  ; There is no other hand: what the robot holds has to be put down first.
  (:action switch_on
    :parameters (?device - appliance)
    :precondition (and (near ?device) (hand_free) (not (switched_on ?device)))
    :effect (probabilistic 0.9 (switched_on ?device))))
