; A bottle and a box into one crate.
(define (problem gift-set)
  (:domain kitting)
  (:objects
    wine - bottle
    chocolates - box
    crate1 - crate)
  (:init (gripper_free) (in_view wine) (in_view chocolates))
  (:goal (and (packed wine crate1) (packed chocolates crate1)))
  (:goal-probability 0.85))
