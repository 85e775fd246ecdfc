(define (domain house)
  (:predicates (lit ?r) (seen ?r))
  (:action look
    :precondition (adn (lit hall) (seen hall))
    :effect (nad (lit hall) (not (seen hall)))))
