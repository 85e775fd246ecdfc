(define (domain house)
  (:predicates (lit ?r))
(and
  (:action wait
    :effect (lit hall))
)
