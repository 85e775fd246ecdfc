(define (domain d)
  (:types car - vehicle vehicle - thing thing - car)
  (:predicates (p ?x - car))
  (:action go :parameters (?x - car) :effect (p ?x)))
