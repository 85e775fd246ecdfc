define (domain house)
  (:predicates (lit ?r) (seen ?r))
  :action look
    :effect (seen hall))
  (:action wait
    :effect (lit hall)))
