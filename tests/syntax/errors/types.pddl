(define (domain house)
  (:types room - place - thing)
  (:constants hall - )
  (:predicates (lit ?r - (either)) (seen ?r -)))
