; The vase is to be given to Ben himself.
(define (problem fragile-parcel)
  (:domain delivery)
  (:objects
    ben - person
    desk7 - desk
    vase - parcel)
  (:init
    (at reception)
    (sits_at ben desk7)
    (addressed vase ben)
    (fragile vase)
    (carrying vase)
    (unknown (present ben)))
  (:goal (handed vase ben))
  (:goal-probability 0.8))
