; Two suspects, and a meter that is wrong in 3 of 20 cases.
(define (problem old-meter)
  (:domain diagnosis)
  (:objects cable motor - part)
  (:init
    (probabilistic
      0.5 (faulty cable)
      0.5 (faulty motor))
    (= (price cable) 8) (= (price motor) 30))
  (:goal (forall (?part - part) (not (faulty ?part))))
  (:metric minimize (total-cost)))
