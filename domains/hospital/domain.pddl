; A hospital robot carries medicine from the pharmacy to the nurses on the wards. Doors fall shut or are
; bolted, the lift breaks down, nurses are elsewhere, the battery runs low, and a box may be dropped:
; everything can be mended, so the robot gets there in the end.
(define (domain hospital)
  (:requirements :typing :negative-preconditions :equality :disjunctive-preconditions
                 :existential-preconditions :universal-preconditions :conditional-effects
                 :universal-effects :action-costs :probabilistic-effects :unknown)
  (:types
    ward - room
    room door nurse box - object)

  (:predicates
    (at ?room - room)
    (joins ?door - door ?from ?to - room)
    (lift_stop ?room - room)
    (dock ?room - room)
    (works_on ?nurse - nurse ?ward - ward)
    (ordered_by ?box - box ?nurse - nurse)
    (external (open ?door - door))
    (external (unknown (bolted ?door - door)))   ; unknown until the robot has pushed against it
    (external (lift_works))
    (external (lift_at ?room - room))
    (external (unknown (present ?nurse - nurse)))   ; at the nurses' station of her ward
    (battery_low)
    (lies_in ?box - box ?room - room)
    (on_tray ?box - box)
    (given ?box - box))

  (:functions (total-cost))

  ; One drive in twenty brings the battery down, and on a low one the robot creeps; one door in ten falls shut
  ; behind it.
  (:action drive
    :parameters (?door - door ?from ?to - room)
    :precondition (and
      (at ?from)
      (or (joins ?door ?from ?to) (joins ?door ?to ?from))
      (open ?door))
    :effect (and
      (at ?to)
      (not (at ?from))
      (probabilistic 1/20 (battery_low))
      (probabilistic 1/10 (not (open ?door)))
      (increase (total-cost) 2)
      (when (battery_low) (increase (total-cost) 2))))

  ; A door that gives way is open; one that does not is bolted on the other side.
  (:action push
    :parameters (?door - door ?from - room)
    :precondition (and
      (at ?from)
      (exists (?to - room) (or (joins ?door ?from ?to) (joins ?door ?to ?from)))
      (not (open ?door))
      (or (not (bolted ?door)) (unknown (bolted ?door))))
    :effect (and
      (when (not (bolted ?door)) (probabilistic 9/10 (open ?door)))
      (when (unknown (bolted ?door))
        (probabilistic
          4/5 (and (open ?door) (not (bolted ?door)))
          1/5 (bolted ?door)))
      (increase (total-cost) 1)))

  ; Somebody behind the door hears the bell, three times in four, and opens.
  (:action ring
    :parameters (?door - door ?from - room)
    :precondition (and
      (at ?from)
      (exists (?to - room) (or (joins ?door ?from ?to) (joins ?door ?to ?from)))
      (not (open ?door))
      (bolted ?door))
    :effect (and
      (probabilistic 3/4 (and (open ?door) (not (bolted ?door))))
      (increase (total-cost) 3)))

  (:action call_lift
    :parameters (?room - room)
    :precondition (and (at ?room) (lift_stop ?room) (lift_works) (not (lift_at ?room)))
    :effect (and
      (probabilistic
        9/10 (and
          (lift_at ?room)
          (forall (?other - room) (when (not (= ?other ?room)) (not (lift_at ?other)))))
        1/20 (not (lift_works)))
      (increase (total-cost) 2)))

  ; The lift may stop before its doors have closed, and wants a technician then.
  (:action ride
    :parameters (?from ?to - room)
    :precondition (and
      (not (= ?from ?to))
      (at ?from)
      (lift_at ?from)
      (lift_stop ?to)
      (lift_works)
      (not (battery_low)))
    :effect (and
      (probabilistic
        19/20 (and (at ?to) (lift_at ?to) (not (at ?from)) (not (lift_at ?from)))
        1/20 (not (lift_works)))
      (increase (total-cost) 3)))

  (:action report_lift
    :precondition (not (lift_works))
    :effect (and (probabilistic 4/5 (lift_works)) (increase (total-cost) 6)))

  (:action charge
    :parameters (?room - room)
    :precondition (and (at ?room) (dock ?room) (battery_low))
    :effect (and (not (battery_low)) (increase (total-cost) 5)))

  ; One box at a time; the arm wants a battery that is not low.
  (:action pick_up
    :parameters (?box - box ?room - room)
    :precondition (and
      (at ?room)
      (lies_in ?box ?room)
      (forall (?other - box) (not (on_tray ?other)))
      (not (battery_low)))
    :effect (and
      (probabilistic 9/10 (and (on_tray ?box) (not (lies_in ?box ?room))))
      (increase (total-cost) 1)))

  (:action look_for
    :parameters (?nurse - nurse ?ward - ward)
    :precondition (and (at ?ward) (works_on ?nurse ?ward) (unknown (present ?nurse)))
    :effect (and
      (probabilistic
        3/5 (present ?nurse)
        2/5 (not (present ?nurse)))
      (increase (total-cost) 1)))

  ; A pager beeps; the robot waits at the station, and one time in four nobody comes.
  (:action page
    :parameters (?nurse - nurse ?ward - ward)
    :precondition (and (at ?ward) (works_on ?nurse ?ward) (not (present ?nurse)))
    :effect (and (probabilistic 3/4 (present ?nurse)) (increase (total-cost) 2)))

  ; She takes the box off the tray, or is called away, or it falls.
  (:action hand_over
    :parameters (?box - box ?nurse - nurse ?ward - ward)
    :precondition (and
      (at ?ward)
      (works_on ?nurse ?ward)
      (ordered_by ?box ?nurse)
      (on_tray ?box)
      (present ?nurse))
    :effect (and
      (probabilistic
        17/20 (and (given ?box) (not (on_tray ?box)))
        1/10 (unknown (present ?nurse))
        1/20 (and (lies_in ?box ?ward) (not (on_tray ?box))))
      (increase (total-cost) 1))))
