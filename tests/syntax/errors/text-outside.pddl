(define (domain house)
  (:predicates (lit ?r)))
(:plan (look hall))
and so on
