"""What is believed of the worlds of a component, as lists or as diagrams, and how it is changed."""
