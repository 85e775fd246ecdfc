"""What a task can reach, ignoring deletes, as a Datalog program."""
