"""From policies to trees: rules, and the tree that follows them."""
