"""Planning for success by a deadline: backward induction over steps of time."""
