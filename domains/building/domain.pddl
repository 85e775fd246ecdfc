; A robot brings letters through an office building. People push doors open, which fall shut by themselves, they crowd
; corridors, and they call the lift. Driving takes time, and battery.
(define (domain building)
  (:requirements :typing :equality :negative-preconditions :conditional-effects :universal-effects
                 :probabilistic-effects :numeric-fluents)
  (:types place door - object)
  (:predicates
    (at ?place - place)
    (way ?from ?to - place)                ; a corridor without doors
    (doorway ?door - door ?from ?to - place)
    (open ?door - door)
    (busy ?place - place)                  ; people pass here
    (crowded ?place - place)
    (landing ?place - place)               ; of the lift
    (cabin ?place - place)                 ; the lift waits here
    (dock ?place - place)
    (post ?place - place)                  ; where letters are given out
    (desk ?place - place)                  ; where this one goes
    (loaded)
    (delivered))
  (:functions (battery) - (int 0 10))

  ; --- what happens by itself, second by second -------------------------------------------------
  (:exogenous somebody-opens
    :parameters (?door - door)
    :precondition (not (open ?door))
    :per second
    :effect (probabilistic 1/40 (open ?door)))

  (:exogenous falls-shut
    :parameters (?door - door)
    :precondition (open ?door)
    :per second
    :effect (probabilistic 1/20 (not (open ?door))))

  (:exogenous people-come
    :parameters (?place - place)
    :precondition (and (busy ?place) (not (crowded ?place)))
    :per second
    :effect (probabilistic 1/60 (crowded ?place)))

  (:exogenous people-leave
    :parameters (?place - place)
    :precondition (crowded ?place)
    :per second
    :effect (probabilistic 1/15 (not (crowded ?place))))

  (:exogenous lift-is-called
    :parameters (?place - place)
    :precondition (cabin ?place)
    :per second
    :effect (probabilistic 1/90 (not (cabin ?place))))

  ; --- what the robot does ------------------------------------------------------------------------
  (:action drive
    :parameters (?from ?to - place)
    :precondition (and (at ?from) (way ?from ?to) (>= (battery) 1))
    :while (not (crowded ?to))
    :duration (triangular 6 8 15)
    :effect (and (not (at ?from)) (at ?to) (decrease (battery) 1)))

  (:action pass
    :parameters (?door - door ?from ?to - place)
    :precondition (and (at ?from) (doorway ?door ?from ?to) (>= (battery) 1))
    :while (open ?door)
    :duration 4
    :effect (and (not (at ?from)) (at ?to) (decrease (battery) 1)))

  (:action charge
    :parameters (?place - place)
    :precondition (and (at ?place) (dock ?place) (< (battery) 10))
    :duration 60
    :effect (increase (battery) 4))

  ; Not every push gets a heavy door open.
  (:action push
    :parameters (?door - door ?from ?to - place)
    :precondition (and (at ?from) (doorway ?door ?from ?to) (not (open ?door)))
    :duration (uniform 3 6)
    :effect (probabilistic 0.7 (open ?door)))

  ; After a minute somebody upstairs has kept the lift.
  (:action call-lift
    :parameters (?place - place)
    :precondition (and (at ?place) (landing ?place) (not (cabin ?place)))
    :duration (triangular 5 20 90)
    :timeout 60
    :effect (and
      (cabin ?place)
      (forall (?other - place) (when (not (= ?other ?place)) (not (cabin ?other))))))

  (:action ride
    :parameters (?from ?to - place)
    :precondition (and (at ?from) (landing ?from) (landing ?to) (not (= ?from ?to)) (cabin ?from))
    :duration 15
    :effect (and (not (at ?from)) (at ?to) (not (cabin ?from)) (cabin ?to)))

  (:action load
    :parameters (?place - place)
    :precondition (and (at ?place) (post ?place) (not (loaded)) (not (delivered)))
    :duration 5
    :effect (loaded))

  ; Nobody may be at the desk.
  (:action hand-over
    :parameters (?place - place)
    :precondition (and (at ?place) (desk ?place) (loaded))
    :duration (uniform 5 20)
    :timeout 15
    :effect (and (not (loaded)) (delivered)))

  (:action wait
    :duration 3
    :effect ()))
