"""What cannot matter to the goal is left out of a task."""
