"""BehaviorTree.CPP: the XML of a tree, its project, and the way back."""
