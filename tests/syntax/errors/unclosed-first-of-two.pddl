(define (domain house)
  (:predicates (lit ?r))
  (:action wait
    :effect (lit hall))

(define (problem evening)
  (:domain house)
  (:goal (lit hall)))
