(define (domain patrol)
  (:requirements :unknown :typing :negative-preconditions)
  (:types thing)
  (:predicates (known ?t - thing) (unknown ?a ?b - thing) (battery) (lamp) (on))
  (:action look
    :parameters (?t - thing)
    :precondition (and (not (known ?t)) (unknown lamp) (unknown ?t ?t))
    :effect (and (known ?t) (lamp)))
  (:action leave
    :precondition (and (known battery) (known lamp) (known (lamp)))
    :effect (and (on) (not (unknown lamp)) (unknown (battery)))))

(define (problem tonight)
  (:domain patrol)
  (:objects battery motor - thing)
  (:init (known motor) (unknown lamp) (unknown battery motor) (not (unknown battery)))
  (:goal (and (on) (known motor) (known (battery)) (unknown battery))))
