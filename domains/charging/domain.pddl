; A security robot patrols rooms and goes back to its dock when the battery is low. Docking may miss
; the contacts, and whether current flows is only known after a look at the charger.
(define (domain charging)
  (:requirements :typing :negative-preconditions :equality :conditional-effects :universal-effects
                 :existential-preconditions :probabilistic-effects :rewards :unknown)
  (:types
    dock room - place
    place level - object)
  (:constants full half low - level)

  (:predicates
    (at ?place - place)
    (patrolled ?room - room)
    (battery ?level - level)
    (unknown (docked)))        ; does current flow? unknown between docking and the check

  ; Every drive costs one level; with a low battery the robot does not leave for a patrol.
  (:action drive
    :parameters (?to - room)
    :precondition (not (battery low))
    :effect (and
      (at ?to)
      (forall (?other - place) (when (not (= ?other ?to)) (not (at ?other))))
      (not (docked))
      (when (battery full) (and (not (battery full)) (battery half)))
      (when (battery half) (and (not (battery half)) (battery low)))))

  ; People in the way spoil one scan in ten.
  (:action scan
    :parameters (?room - room)
    :precondition (at ?room)
    :effect (probabilistic 0.9 (and (patrolled ?room) (increase (reward) 10))))

  ; Creeping speed: works on a low battery, but one time in twenty the robot strands on the way.
  (:action return_to_dock
    :parameters (?dock - dock)
    :precondition (not (at ?dock))
    :effect (probabilistic 0.95 (and (at ?dock) (forall (?room - room) (not (at ?room))))))

  (:action dock
    :parameters (?dock - dock)
    :precondition (and (at ?dock) (not (docked)))
    :effect (unknown (docked)))

  (:action check_charger
    :precondition (and (exists (?dock - dock) (at ?dock)) (unknown (docked)))
    :effect (probabilistic
      0.8 (docked)
      0.2 (not (docked))))

  (:action charge
    :precondition (docked)
    :effect (and
      (battery full)
      (forall (?level - level) (when (not (= ?level full)) (not (battery ?level)))))))
