; `(at hall)` is forgotten in `:init`: who is nowhere gets nowhere.
(define (domain rounds)
  (:requirements :typing)
  (:types place)
  (:predicates (at ?place - place) (linked ?from ?to - place))
  (:action go
    :parameters (?from ?to - place)
    :precondition (and (at ?from) (linked ?from ?to))
    :effect (and (at ?to) (not (at ?from)))))

(define (problem walk)
  (:domain rounds)
  (:objects hall lab - place)
  (:init (linked hall lab))
  (:goal (at lab)))
