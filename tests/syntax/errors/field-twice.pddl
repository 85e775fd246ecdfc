(define (domain house)
  (:predicates (lit ?r))
  (:action look
    :effect (lit hall)
    :effect (lit attic)))
