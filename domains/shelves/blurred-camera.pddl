; Two shelves, and a camera that is wrong in 3 of 20 pictures.
(define (problem blurred-camera)
  (:domain shelves)
  (:objects left right - shelf)
  (:init (robot-at left) (oneof (tin-at left) (tin-at right)))
  (:goal (holding))
  (:goal-probability 0.95))
