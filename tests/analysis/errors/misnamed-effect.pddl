; The effect should say `ready`, says `done`, and both are declared.
(define (domain brew)
  (:predicates (hot) (ready) (done))
  (:action heat :effect (hot))
  (:action pour :precondition (hot) :effect (done)))

(define (problem tea)
  (:domain brew)
  (:init)
  (:goal (ready)))
