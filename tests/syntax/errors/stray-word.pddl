(define (domain house)
  (:predicates (lit ?r)) 07
  (:action wait
    :effect (lit hall)))
