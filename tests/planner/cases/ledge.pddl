; Jumping is the likeliest next step, and cannot be undone: the ladder is sure.
(define (domain ledge)
  (:predicates (down) (hurt) (ladder-set))
  (:action jump
    :precondition (and (not (down)) (not (hurt)))
    :effect (probabilistic 3/5 (down) 2/5 (and (down) (hurt))))
  (:action set-ladder
    :precondition (and (not (ladder-set)) (not (hurt)))
    :effect (ladder-set))
  (:action climb-down
    :precondition (and (ladder-set) (not (down)) (not (hurt)))
    :effect (down)))
(define (problem get-down) (:domain ledge)
  (:init)
  (:goal (and (down) (not (hurt))))
  (:goal-probability 0.99))
