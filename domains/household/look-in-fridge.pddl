; Find out whether the soda is in the fridge: either answer will do.
(define (problem look-in-fridge)
  (:domain household)
  (:objects soda - item)
  (:init (unknown (in_fridge soda)))
  (:goal (known (in_fridge soda))))
