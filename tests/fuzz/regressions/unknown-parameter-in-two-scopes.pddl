(define (domain d) (:predicates (p ?x))
  (:action a :parameters (?abc1) :precondition (p ?abcd) :effect (p ?abc1))
  (:action b :parameters (?other) :precondition (p ?abcd) :effect (p ?other)))
