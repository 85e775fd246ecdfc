; The way that gets across at once more often is not the best first step: the other may end on a sandbank.
(define (domain ford)
  (:predicates (this-bank) (sandbank) (that-bank) (drowned))
  (:action wade
    :precondition (and (this-bank) (not (that-bank)))
    :effect (and (not (this-bank)) (probabilistic 1/2 (that-bank))))
  (:action leap
    :precondition (and (this-bank) (not (that-bank)))
    :effect (and (not (this-bank)) (probabilistic 1/4 (that-bank) 1/4 (drowned) 1/2 (sandbank))))
  (:action wade-on
    :precondition (and (sandbank) (not (that-bank)))
    :effect (and (not (sandbank)) (probabilistic 4/5 (that-bank) 1/5 (drowned)))))
(define (problem cross) (:domain ford)
  (:init (this-bank))
  (:goal (that-bank))
  (:goal-probability 0.65))
