(define (domain house)
  (:predicates (lit ?r))
  (:action look
    :precondition
    :effect (lit hall))
  (:action turn
    :effect)
  (:template find
    :parameters (?r)
    :effect (lit ?r)))
