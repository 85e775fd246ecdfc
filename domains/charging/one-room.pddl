; The battery is low and one room is still to be patrolled: charge first.
(define (problem one-room)
  (:domain charging)
  (:objects
    station - dock
    lobby - room)
  (:init (at station) (battery low))
  (:goal (patrolled lobby))
  (:goal-probability 0.9))
