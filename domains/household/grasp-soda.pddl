; The soda stands in view; hold it with probability 0.5, although a grasp holds one time in five.
(define (problem grasp-soda)
  (:domain household)
  (:objects
    table1 - place
    soda - item)
  (:init (seen soda) (luminousity_ok))
  (:goal (grasped soda))
  (:goal-probability 0.5))
