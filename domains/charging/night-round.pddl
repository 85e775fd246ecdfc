; Three rooms, and a battery for two drives: the robot has to charge in between.
(define (problem night-round)
  (:domain charging)
  (:objects
    station - dock
    lobby store workshop - room)
  (:init (at station) (battery full))
  (:goal (and (patrolled lobby) (patrolled store) (patrolled workshop)))
  (:goal-probability 0.85))
