; Two parts, and light to see them by.
(define (problem in-the-light)
  (:domain press)
  (:objects lid base - part)
  (:init (lit) (probabilistic 0.3 (upside-down lid)) (unknown (upside-down base)))
  (:goal (and (pressed lid) (not (spoilt lid)) (pressed base) (not (spoilt base)))))
