(define (domain house)
  (:predicates (lit ?r) (seen ?r))
  (:action look
    :parameters (?r)
    :effect (seen ?r)
  (:action wait
    :effect (lit hall)))
