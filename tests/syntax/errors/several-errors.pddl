; Each of these is reported, and none of them twice.
(define (domain house)
  (:predicates (lit ?r) dark (seen - room))
  (:action look
    :parameters (r)
    :effect (seen ?r))
  (:action wait
    :effect (or (lit hall) (dark)))
  (:action turn
    :precondition (probabilistic 0.5 (lit hall))
    :effect (probabilistic (lit hall) 0.5 (dark))))
