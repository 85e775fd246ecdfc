; Two parts out of a full bin.
(define (problem two-parts)
  (:domain bin-picking)
  (:init (unknown (free-part)) (tray) (= (in-bin) 6) (= (in-tray) 0) (= (wanted) 2))
  (:goal (done))
  (:goal-probability 0.95))
