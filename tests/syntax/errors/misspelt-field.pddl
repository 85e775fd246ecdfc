; The field is misspelt: the near name is offered.
(define (domain house)
  (:predicates (lit ?r) (seen ?r))
  (:action look
    :parameters (?r)
    :precondtion (lit ?r)
    :effect (seen ?r)))
