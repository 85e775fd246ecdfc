; Five parts, and no tray at first.
(define (problem full-tray)
  (:domain bin-picking)
  (:init (unknown (free-part)) (= (in-bin) 8) (= (in-tray) 0) (= (wanted) 4))
  (:goal (done))
  (:goal-probability 0.95))
