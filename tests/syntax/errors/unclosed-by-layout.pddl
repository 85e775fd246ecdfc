; The parenthesis under `(:action` closes the `and`: the layout shows what is open.
(define (domain house)
  (:predicates (lit ?r) (seen ?r))
  (:action look
    :parameters (?r)
    :effect (and
      (when (lit ?r)
        (seen ?r)
      (not (lit ?r))
    )
  )
  (:action wait
    :effect (lit hall)))
