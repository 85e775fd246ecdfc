; An arm that drives up to a part, grasps it, which may take too long, and puts it down.
(define (domain cell)
  (:requirements :negative-preconditions :probabilistic-effects)
  (:predicates (near) (holding) (placed))
  (:action approach
    :precondition (not (near))
    :duration 2
    :effect (probabilistic 0.9 (near)))
  (:action grasp
    :precondition (and (near) (not (holding)))
    :duration (uniform 1 5)
    :timeout 4
    :effect (probabilistic 0.8 (holding) 0.2 (not (near))))
  (:action put
    :precondition (holding)
    :duration 1
    :effect (and (placed) (not (holding)))))

(define (problem grasp-and-put)
  (:domain cell)
  (:init)
  (:goal (placed))
  (:goal-probability 0.5))
