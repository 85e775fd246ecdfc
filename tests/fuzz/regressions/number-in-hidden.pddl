(define (domain d) (:predicates (p)) (:functions (total-cost)))
(define (problem q) (:domain d) (:init) (:hidden (p) (= (total-cost) 1)) (:goal (p)))
