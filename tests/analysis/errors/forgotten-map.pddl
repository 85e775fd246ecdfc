; `(linked hall lab)` is forgotten in `:init`: only the way back is there.
(define (domain rounds)
  (:requirements :typing)
  (:types place parcel)
  (:predicates (at ?place - place) (linked ?from ?to - place) (waits ?parcel - parcel ?place - place)
               (carried ?parcel - parcel))
  (:action go
    :parameters (?from ?to - place)
    :precondition (and (at ?from) (linked ?from ?to))
    :effect (and (at ?to) (not (at ?from))))
  (:action pick_up
    :parameters (?parcel - parcel ?place - place)
    :precondition (and (at ?place) (waits ?parcel ?place))
    :effect (carried ?parcel)))

(define (problem fetch)
  (:domain rounds)
  (:objects hall lab - place letter - parcel)
  (:init (at hall) (linked lab hall) (waits letter lab))
  (:goal (carried letter)))
