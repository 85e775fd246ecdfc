"""Mutation testing: small changes of the code that some test has to notice.

Of the libraries for it, cosmic-ray and mutatest change the checkout itself, and none (mutmut 3 included)
draws a sample by a seed, picks the tests to run by the package that a mutant is in, and knows a survivor
again that was explained before, once lines have moved. What is left to do is little: the syntax trees of the
standard library, copies of the checkout, pytest.
"""
