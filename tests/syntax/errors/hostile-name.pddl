(define (domain house)
  (:predicates (lit ?r))
  (:action a"); import os #
    :effect (lit hall))
  (:action `b`
    :effect (lit hall)))
