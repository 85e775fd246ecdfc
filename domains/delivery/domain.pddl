; A robot brings letters and parcels to people in an office, who may not be at their desks. What
; cannot be handed over goes to the reception, but fragile things only while it is staffed.
(define (domain delivery)
  (:requirements :adl :probabilistic-effects :unknown :templates)
  (:types
    letter parcel - thing
    desk front_desk - room
    thing room person - object)
  (:constants reception - front_desk)

  (:predicates
    (at ?room - room)
    (sits_at ?person - person ?desk - desk)
    (addressed ?thing - thing ?to - person)
    (fragile ?thing - thing)
    (staffed ?room - front_desk)
    (carrying ?thing - thing)
    (voicemail ?person - person)
    (unknown (present ?person - person))
    (handed ?thing - thing ?to - person)
    (left ?thing - thing ?room - front_desk))

  (:action go_to
    :parameters (?to - room)
    :effect (probabilistic
      0.95 (and
        (at ?to)
        (forall (?room - room) (when (not (= ?room ?to)) (not (at ?room)))))))

  (:action knock
    :parameters (?person - person ?desk - desk)
    :precondition (and (unknown (present ?person)) (sits_at ?person ?desk) (at ?desk))
    :effect (probabilistic
      0.7 (present ?person)
      0.3 (not (present ?person))))

  ; Whoever is in the house comes to the desk; three in five do not pick up, and the voicemail answers
  ; from then on.
  (:action phone
    :parameters (?person - person)
    :precondition (and (not (present ?person)) (not (voicemail ?person)))
    :effect (probabilistic
      2/5 (present ?person)
      3/5 (voicemail ?person)))

  (:action hand_over
    :parameters (?thing - thing ?to - person ?desk - desk)
    :precondition (and
      (carrying ?thing)
      (addressed ?thing ?to)
      (sits_at ?to ?desk)
      (at ?desk)
      (present ?to))
    :effect (probabilistic 0.98 (and (handed ?thing ?to) (not (carrying ?thing)))))

  (:action leave
    :parameters (?thing - (either letter parcel) ?room - front_desk)
    :precondition (and (carrying ?thing) (at ?room) (imply (fragile ?thing) (staffed ?room)))
    :effect (probabilistic            ; the flap of the tray sticks at times
      9/10 (and (left ?thing ?room) (not (carrying ?thing)))))

  (:action ring_bell
    :parameters (?room - front_desk)
    :precondition (and (at ?room) (not (staffed ?room)))
    :effect (probabilistic 3/4 (staffed ?room)))

  ; Go to the desk, knock while it is not known whether the person is there, phone if not, hand over.
  (:template deliver
    :parameters (?thing - thing ?to - person ?desk - desk)
    :precondition (and (carrying ?thing) (addressed ?thing ?to) (sits_at ?to ?desk))
    :effect (probabilistic 0.76 (handed ?thing ?to))
    :body (sequence
      (fallback (condition (at ?desk)) (go_to ?desk))
      (condition (at ?desk))              ; the way there may have been blocked
      (fallback
        (skipper
          (condition (present ?to))
          (sequence (knock ?to ?desk) (condition (known (present ?to)))))
        (sequence (action phone ?to) (condition (present ?to))))
      (hand_over ?thing ?to ?desk)
      (condition (handed ?thing ?to)))))
