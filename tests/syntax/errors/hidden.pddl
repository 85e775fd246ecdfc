(define (problem q)
  (:domain d)
  (:hidden (p) (= (total-cost) 1))
  (:hidden (not (or (p) (q))) (p)))
