(define (problem evening)
  (:domain house)
  (:init
    (lit hall)
    (lit kitchen
    (lit garage)
  )
  (:goal (lit hall)))
