; To grip leaves unknown whether something is held; only feeling for it tells, and mostly that it is not.
(define (domain gripper)
  (:predicates (held) (moved))
  (:action grip
    :precondition (not (held))
    :effect (and (unknown (held)) (moved)))
  (:action feel
    :precondition (unknown (held))
    :effect (probabilistic 1/5 (held) 4/5 (not (held)))))
(define (problem hold) (:domain gripper)
  (:init)
  (:goal (held))
  (:goal-probability 0.99))
