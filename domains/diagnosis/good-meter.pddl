; The cable is the usual suspect, the motor is dear.
(define (problem good-meter)
  (:domain diagnosis)
  (:objects cable sensor motor - part)
  (:init
    (good-meter)
    (probabilistic
      0.5 (faulty cable)
      0.3 (faulty sensor)
      0.2 (faulty motor))
    (= (price cable) 4) (= (price sensor) 10) (= (price motor) 30))
  (:goal (forall (?part - part) (not (faulty ?part))))
  (:metric minimize (total-cost)))
