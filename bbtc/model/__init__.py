"""The resolved, still lifted model of a domain and a problem."""
