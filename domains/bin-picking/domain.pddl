; A cell: an arm takes parts out of a bin, under a camera, and puts them into a tray. The cycle is short, parts lie as they
; fell, and the tray is changed by somebody else.
(define (domain bin-picking)
  (:requirements :negative-preconditions :probabilistic-effects :numeric-fluents :unknown)
  (:predicates
    (unknown (free-part)) ; does a part lie so that it can be taken? unknown until the camera has looked
    (holding)
    (tray)                    ; is there a tray to put parts in?
    (done))
  (:functions (in-bin) - (int 0 9) (in-tray) - (int 0 9) (wanted))

  (:exogenous tray-is-taken
    :per second
    :precondition (tray)
    :effect (probabilistic 1/120 (not (tray))))

  (:exogenous tray-is-brought
    :per second
    :precondition (not (tray))
    :effect (probabilistic 1/4 (tray)))

  (:exogenous part-slips
    :per second
    :precondition (holding)
    :effect (probabilistic 1/100 (not (holding))))

  (:action look
    :precondition (and (unknown (free-part)) (> (in-bin) 0))
    :duration 0.4
    :effect (probabilistic
      0.85 (free-part)
      0.15 (not (free-part))))

  ; A grasp that takes longer than three seconds is given up: the part is wedged.
  (:action grasp
    :precondition (and (free-part) (not (holding)) (> (in-bin) 0))
    :duration (triangular 1.2 1.8 4)
    :timeout 3
    :on-timeout (unknown (free-part))
    :effect (and
      (unknown (free-part))
      (probabilistic 0.92 (and (holding) (decrease (in-bin) 1)))))

  (:action shake
    :precondition (not (free-part))
    :duration 2
    :effect (unknown (free-part)))

  (:action place
    :precondition (holding)
    :while (tray)
    :duration (uniform 1 1.5)
    :effect (and (not (holding)) (increase (in-tray) 1)))

  (:action wait
    :duration 0.5
    :effect ())

  (:action hand-over
    :precondition (>= (in-tray) (wanted))
    :duration 1
    :effect (done)))
