; `(unknown (seen soda))` and `(unknown (seen sprayer))` are forgotten in `:init`.
(define (domain cans)
  (:requirements :typing :unknown :probabilistic-effects)
  (:types item)
  (:predicates (seen ?item - item) (light_ok) (grasped ?item - item))
  (:action light_on :effect (light_ok))
  (:action detect
    :parameters (?item - item)
    :precondition (and (light_ok) (unknown (seen ?item)))
    :effect (probabilistic 0.5 (seen ?item) 0.5 (not (seen ?item))))
  (:action grasp
    :parameters (?item - item)
    :precondition (seen ?item)
    :effect (probabilistic 0.8 (grasped ?item))))

(define (problem tidy-up)
  (:domain cans)
  (:objects soda sprayer - item)
  (:init (light_ok))
  (:goal (and (grasped soda) (grasped sprayer))))
