"""BehaviorTree.CPP XML back into trees, also where people edited it."""
