(define (problem two-letters)
  (:domain courier)
  (:objects
    lab office - room
    letter1 letter2 - letter)
  (:init
    (has letter1)
    (has letter2)
    (for letter1 lab)
    (for letter2 office)
    (unknown (open lab))
    (unknown (open office)))
  (:goal (and (delivered letter1) (delivered letter2)))
  (:goal-probability 0.9))
