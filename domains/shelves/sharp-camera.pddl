; Three shelves, and a camera that does not err.
(define (problem sharp-camera)
  (:domain shelves)
  (:objects left middle right - shelf)
  (:init (robot-at left) (sharp) (oneof (tin-at left) (tin-at middle) (tin-at right)))
  (:goal (holding)))
