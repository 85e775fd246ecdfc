; The paper's scenario: find a soda can with probability 0.9.
(define (problem look-for-soda)
  (:domain household)
  (:objects
    table1 table2 - place
    soda sprayer - item)
  (:init (unknown (seen soda)) (unknown (seen sprayer)))
  (:goal (seen soda))
  (:goal-probability 0.9))
