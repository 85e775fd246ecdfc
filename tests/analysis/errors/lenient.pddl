; Read as planners do: each misspelt name is a name of its own, and told once.
(define (domain shed)
  (:types box)
  (:constants red blue - box)
  (:predicates (free ?b - box) (on ?a ?b - box) (done))
  (:action clear
    :parameters (?b - box)
    :precondition (and (on ?b blue) (not (free gren)))
    :effect (and (free ?b) (not (on ?b bleu)) (not (on bleu ?b))))
  (:action finish
    :precondition (forall (?b - box) (free ?b))
    :effect (and (done) (not (onn red blue)))))
(define (problem evening)
  (:domain shed)
  (:objects green - box)
  (:init (on green blue) (on red blue) (on blue blue))
  (:goal (done)))
