(define (domain house)
  (:predicates (lit ?r) (café))
  (:action wait
    :effect (lit hall)))
