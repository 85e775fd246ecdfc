; One item, on one of two shelves.
(define (problem one-order)
  (:domain warehouse)
  (:objects
    packing - station
    a1 a2 - shelf
    drill - item)
  (:init
    (at packing)
    (aisle packing a1)
    (aisle a1 a2)
    (= (length packing a1) 5)
    (= (length a1 a2) 3)
    (unknown (stored drill a1))
    (unknown (stored drill a2)))
  (:goal (delivered drill))
  (:goal-probability 0.8)
  (:metric minimize (total-cost)))
