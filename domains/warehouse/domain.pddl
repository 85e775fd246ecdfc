; A picking robot fetches items from shelves and brings them to the packing station. Aisles may be
; blocked by pallets, and what stands on a shelf is known only after a scan of its barcode.
(define (domain warehouse)
  (:requirements :typing :negative-preconditions :equality :disjunctive-preconditions
                 :existential-preconditions :derived-predicates :conditional-effects
                 :universal-effects :action-costs :probabilistic-effects :non-deterministic :unknown
                 :templates)
  (:types
    shelf station - spot
    spot item - object)

  (:predicates
    (at ?spot - spot)
    (aisle ?from ?to - spot)
    (blocked ?from ?to - spot)
    (unknown (stored ?item - item ?shelf - shelf))
    (loaded ?item - item)
    (delivered ?item - item)
    (clear ?from ?to - spot)          ; derived
    (reachable ?spot - spot))         ; derived

  (:functions (total-cost) (length ?from ?to - spot))

  ; An aisle works both ways unless a pallet stands in it.
  (:derived (clear ?from ?to - spot)
    (and
      (or (aisle ?from ?to) (aisle ?to ?from))
      (not (blocked ?from ?to))
      (not (blocked ?to ?from))))

  (:derived (reachable ?spot - spot)
    (or
      (at ?spot)
      (exists (?near - spot) (and (reachable ?near) (clear ?near ?spot)))))

  ; The fleet manager plans the way; the robot only needs some way to be free.
  (:action drive
    :parameters (?to - spot)
    :precondition (and (not (at ?to)) (reachable ?to))
    :effect (and
      (at ?to)
      (forall (?spot - spot) (when (not (= ?spot ?to)) (not (at ?spot))))
      (increase (total-cost) 4)))

  (:action move_pallet
    :parameters (?from ?to - spot)
    :precondition (and (blocked ?from ?to) (reachable ?from))
    :effect (and
      (probabilistic 0.9 (not (blocked ?from ?to)))
      (increase (total-cost) (* 2 (length ?from ?to)))))

  (:action scan
    :parameters (?item - item ?shelf - shelf)
    :precondition (and (at ?shelf) (unknown (stored ?item ?shelf)))
    :effect (and
      (probabilistic
        0.7 (stored ?item ?shelf)
        0.2 (not (stored ?item ?shelf))
        0.1 (increase (total-cost) 2))     ; the label cannot be read, and trying took its time
      (increase (total-cost) 1)))

  (:action fetch
    :parameters (?item - item ?shelf - shelf)
    :precondition (and (at ?shelf) (stored ?item ?shelf) (not (loaded ?item)))
    :effect (and
      (probabilistic 0.9 (and (loaded ?item) (not (stored ?item ?shelf))))
      (increase (total-cost) 3)))

  ; Nobody knows how often the belt is free: either it takes the item or it does not.
  (:action hand_in
    :parameters (?item - item ?station - station)
    :precondition (and (loaded ?item) (at ?station))
    :effect (and
      (oneof
        (and (delivered ?item) (not (loaded ?item)))
        ())
      (increase (total-cost) 1)))

  ; One shelf: go there, scan while it is not known whether the item is on it, and fetch it.
  (:template search_shelf
    :parameters (?item - item ?shelf - shelf)
    :body (sequence
      (fallback (condition (at ?shelf)) (drive ?shelf))
      (skipper
        (condition (stored ?item ?shelf))
        (sequence (scan ?item ?shelf) (condition (known (stored ?item ?shelf)))))
      (fetch ?item ?shelf)
      (condition (loaded ?item))))

  ; Shelf by shelf, until the item is on the robot.
  (:template search
    :parameters (?item - item)
    :precondition (and
      (not (loaded ?item))
      (exists (?shelf - shelf) (unknown (stored ?item ?shelf))))
    :effect (probabilistic 0.85 (loaded ?item))
    :body (fallback (foreach (?shelf - shelf) (search_shelf ?item ?shelf)))))
