; An arm fills kits from a bin. The gripper has no tactile sensor: whether a pick held is unknown
; until the force sensor is read, and an item that slips may roll out of view.
(define (domain kitting)
  (:requirements :typing :negative-preconditions :probabilistic-effects :unknown :templates)
  (:types
    bottle box screwdriver - item
    tray crate - container
    item container - object)

  (:predicates
    (in_view ?item - item)
    (gripper_free)
    (unknown (holding ?item - item))
    (packed ?item - item ?into - container)
    (lost ?item - item))

  (:action look_for
    :parameters (?item - item)
    :precondition (and (not (in_view ?item)) (not (lost ?item)))
    :effect (probabilistic 0.9 (in_view ?item)))

  ; Suction cups need a flat or a round side.
  (:action pick
    :parameters (?item - (either bottle box))
    :precondition (and (gripper_free) (in_view ?item) (not (holding ?item)) (not (lost ?item)))
    :effect (and (not (gripper_free)) (unknown (holding ?item))))

  (:action read_force_sensor
    :parameters (?item - item)
    :precondition (unknown (holding ?item))
    :effect (probabilistic
      3/4 (holding ?item)
      1/4 (and
        (not (holding ?item))
        (gripper_free)
        (probabilistic
          1/3 (not (in_view ?item))
          1/12 (and (not (in_view ?item)) (lost ?item))))))

  (:action place
    :parameters (?item - item ?into - container)
    :precondition (holding ?item)
    :effect (and
      (gripper_free)
      (not (holding ?item))
      (probabilistic
        0.95 (packed ?item ?into)
        0.04 (not (in_view ?item))
        0.01 (and (not (in_view ?item)) (lost ?item)))))

  ; Look if need be, pick, and read the sensor. What the body is worth is found by simulating it;
  ; the effect only tells the planner what the template is for.
  (:template secure
    :parameters (?item - (either bottle box))
    :precondition (and (gripper_free) (not (holding ?item)) (not (lost ?item)))
    :effect (probabilistic
      0.75 (holding ?item)
      0.25 (not (holding ?item)))
    :body (sequence
      (fallback (condition (in_view ?item)) (look_for ?item))
      (pick ?item)
      (read_force_sensor ?item)
      (condition (holding ?item)))))
