(define (domain d)
  (:types room person thing letter parcel - thing object - object)
  (:predicates (p ?x - letter))
  (:action go :parameters (?x - letter) :effect (p ?x)))
