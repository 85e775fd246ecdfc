; A tracked robot inspects the valves and gauges of a pump house. Its camera needs light: the lamps of
; the area, which may be broken, or its own torch, which costs battery.
(define (domain inspection)
  (:requirements :typing :negative-preconditions :disjunctive-preconditions
                 :existential-preconditions :universal-preconditions :conditional-effects
                 :universal-effects :probabilistic-effects :action-costs :unknown)
  (:types
    valve gauge - asset
    area asset - object)
  (:constants pump_hall - area)

  (:predicates
    (at ?area - area)
    (located ?asset - asset ?area - area)
    (lit ?area - area)
    (torch_on)
    (lens_clean)
    (jammed ?valve - valve)
    (unknown (closed ?valve - valve))      ; unknown until the camera has seen it
    (in_range ?gauge - gauge))

  (:functions (total-cost))

  (:action drive
    :parameters (?to - area)
    :precondition (not (at ?to))
    :effect (and
      (forall (?area - area) (not (at ?area)))
      (at ?to)
      (increase (total-cost) 2)))

  (:action switch_lamps_on
    :parameters (?area - area)
    :precondition (at ?area)
    :effect (and (probabilistic 0.8 (lit ?area)) (increase (total-cost) 1)))

  (:action switch_torch_on
    :effect (and (torch_on) (increase (total-cost) 5)))

  ; Splashes on the lens; without a wipe the picture may tell nothing.
  (:action wipe_lens
    :effect (and (lens_clean) (increase (total-cost) 3)))

  (:action look_at_valve
    :parameters (?valve - valve ?area - area)
    :precondition (and
      (unknown (closed ?valve))
      (located ?valve ?area)
      (at ?area)
      (or (lit ?area) (torch_on)))
    :effect (and
      (when (lens_clean)
        (probabilistic
          2/3 (closed ?valve)
          1/3 (not (closed ?valve))))
      (when (not (lens_clean))       ; one picture in four is useless: closed stays unknown
        (probabilistic
          1/2 (closed ?valve)
          1/4 (not (closed ?valve))))
      (increase (total-cost) 1)))

  (:action read_gauge
    :parameters (?gauge - gauge ?area - area)
    :precondition (and
      (unknown (in_range ?gauge))
      (located ?gauge ?area)
      (at ?area)
      (or (lit ?area) (torch_on))
      (lens_clean))
    :effect (and
      (probabilistic
        0.95 (in_range ?gauge)
        0.05 (not (in_range ?gauge)))
      (increase (total-cost) 1)))

  (:action turn_valve
    :parameters (?valve - valve ?area - area)
    :precondition (and
      (not (closed ?valve))
      (not (jammed ?valve))
      (located ?valve ?area)
      (at ?area))
    :effect (and
      (probabilistic
        0.7 (closed ?valve)
        0.05 (jammed ?valve))
      (increase (total-cost) 4)))

  ; Vibration pads shake a jammed valve loose, now and then.
  (:action shake_loose
    :parameters (?valve - valve)
    :precondition (jammed ?valve)
    :effect (and
      (when (exists (?area - area) (and (located ?valve ?area) (at ?area)))
        (probabilistic 1/2 (not (jammed ?valve))))
      (increase (total-cost) 8))))
