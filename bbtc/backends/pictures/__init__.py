"""Trees to look at: Graphviz, our own SVG, Mermaid, text."""
