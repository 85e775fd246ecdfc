"""The task as a Markov decision process: its states as arrays, and what can be reached in it at best."""
