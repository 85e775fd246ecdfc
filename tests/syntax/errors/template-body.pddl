(define (domain house)
  (:predicates (lit ?r))
  (:template find
    :parameters (?r)
    :effect (lit ?r)
    :body (sequnce (condition (lit ?r)) (action look ?r)))
  (:template seek
    :parameters (?r)
    :effect (lit ?r)
    :body (sequence (not (lit ?r)) (action look ?r))))
