(define (problem evening)
  (:domain house)
  (:objects hall - room ?x)
  (:init (lit hall) (lit :hall) (lit hall - room) (lit hall) ((lit hall)) (?lit hall)))
