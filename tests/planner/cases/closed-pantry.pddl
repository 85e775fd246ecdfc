; The jar is behind a door that shall be closed at the end, and has to be opened first.
(define (domain pantry)
  (:predicates (closed) (have-jar))
  (:action open-door :effect (not (closed)))
  (:action close-door :precondition (not (closed)) :effect (closed))
  (:action take-jar
    :precondition (and (not (have-jar)) (not (closed)))
    :effect (have-jar)))
(define (problem tidy) (:domain pantry)
  (:init (closed))
  (:goal (and (closed) (have-jar)))
  (:goal-probability 0.99))
