(define (domain house)
  (:predicates (lit ?r))
  (:action wait
    :effect (lit hall))
