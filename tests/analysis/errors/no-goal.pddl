(define (domain d) (:predicates (unknown (p)) (q)) (:action go :effect (p)))
(define (problem x) (:domain d) (:init (q)))
