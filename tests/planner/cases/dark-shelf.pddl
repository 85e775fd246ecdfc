; A look in the light tells whether the can is in view, and if it is not, a search mostly brings it there.
(define (domain shelf)
  (:predicates (in-view) (light))
  (:action switch-light :precondition (not (light)) :effect (light))
  (:action look
    :precondition (and (light) (unknown (in-view)))
    :effect (probabilistic 1/2 (in-view) 1/2 (not (in-view))))
  (:action search-shelf
    :precondition (not (in-view))
    :effect (probabilistic 4/5 (in-view) 1/5 (not (in-view)))))
(define (problem see-the-can) (:domain shelf)
  (:init (unknown (in-view)))
  (:goal (in-view))
  (:goal-probability 0.99))
