; One part, and nothing but the balance.
(define (problem in-the-dark)
  (:domain press)
  (:objects lid - part)
  (:init (probabilistic 0.3 (upside-down lid)))
  (:goal (and (pressed lid) (not (spoilt lid))))
  (:goal-probability 0.95))
