"""Planning where the beliefs have no end: bounds on P* of a partially observable Markov decision process."""
