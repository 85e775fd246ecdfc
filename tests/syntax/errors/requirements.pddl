(define (domain house)
  (:requirements typing :strips)
  (:predicates (lit ?r)))
