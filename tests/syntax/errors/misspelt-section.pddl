(define (domain house)
  (:predicats (lit ?r))
  (:acton look :effect (lit hall)))
