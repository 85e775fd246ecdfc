; One bottle into the tray, nine times in ten.
(define (problem one-bottle)
  (:domain kitting)
  (:objects
    water - bottle
    tray1 - tray)
  (:init (gripper_free))
  (:goal (packed water tray1))
  (:goal-probability 0.9))
