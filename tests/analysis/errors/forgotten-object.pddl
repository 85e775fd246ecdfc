; No object of type camera is declared.
(define (domain watch)
  (:requirements :typing :unknown :probabilistic-effects)
  (:types gate camera)
  (:predicates (shut ?gate - gate) (aimed ?camera - camera ?gate - gate))
  (:action aim :parameters (?camera - camera ?gate - gate) :effect (aimed ?camera ?gate))
  (:action look
    :parameters (?camera - camera ?gate - gate)
    :precondition (and (unknown (shut ?gate)) (aimed ?camera ?gate))
    :effect (probabilistic 0.5 (shut ?gate) 0.5 (not (shut ?gate)))))

(define (problem evening)
  (:domain watch)
  (:objects north - gate)
  (:init (unknown (shut north)))
  (:goal (known (shut north))))
