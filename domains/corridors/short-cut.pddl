; A short way with two doors that may be shut, and a long one with doors that are open.
(define (problem short-cut)
  (:domain corridors)
  (:objects
    lobby office lab canteen - place
    office-door lab-door canteen-door back-door - door)
  (:init
    (robot-at lobby)
    (joins office-door lobby office) (joins office-door office lobby)
    (joins lab-door office lab) (joins lab-door lab office)
    (joins canteen-door lobby canteen) (joins canteen-door canteen lobby)
    (joins back-door canteen lab) (joins back-door lab canteen)
    (= (length office-door) 4) (= (length lab-door) 4)
    (= (length canteen-door) 10) (= (length back-door) 18)
    (open canteen-door) (open back-door)
    (probabilistic 0.8 (open office-door))
    (probabilistic 0.5 (open lab-door)))
  (:goal (robot-at lab))
  (:metric minimize (total-cost)))
