"""Back-ends: from a tree to text."""
