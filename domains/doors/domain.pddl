; A porter robot in an office building at night. A door may be locked, which the robot does not know
; until it tries the handle; then it needs the key from the board, or somebody who opens.
(define (domain doors)
  (:requirements :typing :negative-preconditions :equality :disjunctive-preconditions
                 :existential-preconditions :probabilistic-effects :unknown)
  (:types room door key)

  (:predicates
    (in ?room - room)
    (joins ?door - door ?from ?to - room)
    (fits ?key - key ?door - door)
    (hangs_in ?key - key ?room - room)
    (holding ?key - key)
    (open ?door - door)
    (unknown (locked ?door - door)))   ; unknown until somebody has tried the handle

  (:action try_handle
    :parameters (?door - door ?from - room)
    :precondition (and
      (unknown (locked ?door))
      (in ?from)
      (exists (?to - room) (or (joins ?door ?from ?to) (joins ?door ?to ?from))))
    :effect (probabilistic
      0.6 (and (open ?door) (not (locked ?door)))
      0.4 (locked ?door)))

  ; An old lock: one turn in ten does not catch.
  (:action unlock
    :parameters (?door - door ?key - key ?from - room)
    :precondition (and
      (locked ?door)
      (fits ?key ?door)
      (holding ?key)
      (in ?from)
      (exists (?to - room) (or (joins ?door ?from ?to) (joins ?door ?to ?from))))
    :effect (probabilistic 9/10 (and (open ?door) (not (locked ?door)))))

  ; Somebody in the control room opens the door from afar, if somebody is there: one time in three.
  (:action call_control_room
    :parameters (?door - door)
    :precondition (locked ?door)
    :effect (probabilistic 1/3 (and (open ?door) (not (locked ?door)))))

  (:action take_key
    :parameters (?key - key ?room - room)
    :precondition (and (hangs_in ?key ?room) (in ?room))
    :effect (probabilistic 0.95 (holding ?key)))

  (:action go_through
    :parameters (?door - door ?from ?to - room)
    :precondition (and
      (not (= ?from ?to))
      (or (joins ?door ?from ?to) (joins ?door ?to ?from))
      (in ?from)
      (open ?door))
    :effect (and (not (in ?from)) (in ?to))))
