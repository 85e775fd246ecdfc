(define (domain house)
  (:predicates (lit ?r))
  (:functions (total-cost))
  (:action look
    :effect (probabilistic 1/0 (lit hall)))
  (:action turn
    :effect (probabilistic 1e-999999999 (lit hall)))
  (:action wait
    :effect (increase (total-cost) ?x))
  (:action dim
    :effect (probabilistic half (lit hall))))
