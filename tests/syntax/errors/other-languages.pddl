(define (domain lamps)
  // not a comment
  (:predicates (lit ?l lamp) (powered))
  (:action light :parameters ?l
    :precondition (unknown (and (lit ?l) (powered))))
  (:action all :effect (forall ?l - lamp (lit ?l)))
  (:action tell :precondition (known (or (powered) (powered)))))
