; Anna gets her letter, or it lies at the reception.
(define (problem letter-for-anna)
  (:domain delivery)
  (:objects
    anna - person
    desk12 - desk
    invoice - letter)
  (:init
    (at desk12)
    (staffed reception)
    (sits_at anna desk12)
    (addressed invoice anna)
    (carrying invoice)
    (unknown (present anna)))
  (:goal (or (handed invoice anna) (exists (?room - front_desk) (left invoice ?room))))
  (:goal-probability 0.95))
