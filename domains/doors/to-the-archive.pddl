; One door between the robot and the archive; its key hangs in the hall.
(define (problem to-the-archive)
  (:domain doors)
  (:objects
    hall archive - room
    archive_door - door
    archive_key - key)
  (:init
    (in hall)
    (joins archive_door hall archive)
    (fits archive_key archive_door)
    (hangs_in archive_key hall)
    (unknown (locked archive_door)))
  (:goal (in archive))
  (:goal-probability 0.95))
