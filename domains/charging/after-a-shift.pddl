; Seven shifts in ten leave a half full battery, the others a low one; patrol the lobby, then stand on
; the charger again.
(define (problem after-a-shift)
  (:domain charging)
  (:objects station - dock
            lobby - room)
  (:init (at station)
         (probabilistic
           0.7 (battery half)
           0.3 (battery low)))
  (:goal (and (patrolled lobby) (docked)))
  (:goal-probability 0.8)
  (:goal-reward 50)
  (:metric maximize (reward)))
