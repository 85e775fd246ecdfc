(define (domain house)
  (:predicates (lit ?r) (seen ?r))
  (:action look
    :parameters (?r)
    :precondition (and (lit ?r)) (seen ?r))
    :effect (seen ?r))
  (:action wait
    :effect (lit hall)))
