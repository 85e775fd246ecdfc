; Two things go to the reception, one of them fragile; nobody sits there yet.
(define (problem reception-only)
  (:domain delivery)
  (:objects
    cleo - person
    desk3 - desk
    vase - parcel
    bill - letter)
  (:init
    (at desk3)
    (sits_at cleo desk3)
    (fragile vase)
    (carrying vase)
    (carrying bill)
    (unknown (present cleo)))
  (:goal (forall (?thing - thing) (left ?thing reception)))
  (:goal-probability 0.98))
