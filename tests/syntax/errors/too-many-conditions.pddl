(define (domain house)
  (:predicates (lit ?r) (seen ?r))
  (:action look
    :precondition (lit hall) (seen hall)
    :effect (when (lit hall) (seen hall) (lit attic)))
  (:action turn
    :effect (not (lit hall) (seen hall)))
  (:action dim
    :effect (not (and (lit hall) (seen hall)))))
(define (problem evening)
  (:domain house)
  (:goal (lit hall) (seen hall)))
