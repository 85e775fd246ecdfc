(define (problem to-the-lab)
  (:domain courier)
  (:objects
    lab - room
    letter1 - letter)
  (:init (has letter1) (for letter1 lab) (unknown (open lab)))
  (:goal (delivered letter1))
  (:goal-probability 0.95))
