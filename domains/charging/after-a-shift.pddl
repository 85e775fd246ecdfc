; Seven shifts in ten leave a half full battery, the others a low one; then the lobby is to be
; patrolled, and in the end the robot is to stand in its dock, in contact. The robot knows which it is, but the plan has to be made before.
(define (problem after-a-shift)
  (:domain charging)
  (:objects
    station - dock
    lobby - room)
  (:init
    (at station)
    (probabilistic
      0.7 (battery half)
      0.3 (battery low)))
  (:goal (and (patrolled lobby) (docked)))
  (:goal-probability 0.95)
  (:goal-reward 50)
  (:metric maximize (reward)))
