; The service robot of "Task Planning with Belief Behavior Trees" (Safronov, Colledanchise,
; Natale 2020): it looks for things on tables, opens the fridge and grasps.
; Probabilities are those of the paper's tables.
(define (domain household)
  (:requirements :typing :negative-preconditions :conditional-effects :universal-effects
                 :probabilistic-effects :unknown :templates)
  (:types place item)

  (:predicates
    (at ?place - place)
    (seen ?item - item)          ; in the camera's field of view; unknown until detected
    (luminousity_ok)
    (in_fridge ?item - item)
    (grasped ?item - item)
    (after_grasp ?item - item))

  ; --- looking for things on tables ---------------------------------------------------------

  (:action goto
    :parameters (?place - place)
    :effect (and
      (probabilistic 0.95 (at ?place))
      ; the camera points elsewhere now: whatever was in view has to be detected again
      (forall (?item - item) (unknown (seen ?item)))))

  (:action detect
    :parameters (?item - item)
    :precondition (and (luminousity_ok) (unknown (seen ?item)))
    :effect (probabilistic
      0.5 (seen ?item)
      0.5 (not (seen ?item))))

  (:action light_on
    :effect (luminousity_ok))

  ; Go to one place and look again.
  (:template find_in
    :parameters (?item - item ?place - place)
    :body (sequence
      (goto ?place)
      (detect ?item)
      (condition (known (seen ?item)))
      (condition (seen ?item))))

  ; Try every place. The effect only guides the planner's choice; what a plan is worth is found
  ; by simulating the body.
  (:template find
    :parameters (?item - item)
    :precondition (not (seen ?item))
    :effect (probabilistic
      0.8 (seen ?item)
      0.2 (not (seen ?item)))
    :body (fallback (foreach (?place - place) (find_in ?item ?place))))

  ; --- grasping: where current and future uncertainty meet ----------------------------------

  (:action look_for_object_in_fridge
    :parameters (?item - item)
    :precondition (unknown (in_fridge ?item))
    :effect (probabilistic
      0.5 (in_fridge ?item)
      0.5 (not (in_fridge ?item))))

  ; No tactile sensor: whether the grasp held is not known until it is checked.
  (:action grasp
    :parameters (?item - item)
    :precondition (and (seen ?item) (not (grasped ?item)))
    :effect (and (unknown (grasped ?item)) (after_grasp ?item)))

  (:action after_grasp_check
    :parameters (?item - item)
    :precondition (and (unknown (grasped ?item)) (after_grasp ?item))
    :effect (probabilistic
      0.8 (not (grasped ?item))
      0.2 (grasped ?item))))
