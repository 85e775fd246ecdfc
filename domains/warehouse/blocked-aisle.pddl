; A pallet stands in the aisle to the only shelf; the saw is known to be there.
(define (problem blocked-aisle)
  (:domain warehouse)
  (:objects
    packing - station
    b1 - shelf
    saw drill - item)
  (:init
    (at packing)
    (aisle packing b1)
    (blocked packing b1)
    (= (length packing b1) 6)
    (= (length b1 packing) 6)
    (stored saw b1)
    (unknown (stored drill b1)))
  (:goal (delivered saw))
  (:goal-probability 0.95)
  (:metric minimize (total-cost)))
