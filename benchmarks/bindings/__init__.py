"""Calls of each engine's own binding on UR5, with the work and the outputs of one method of a backend.

They are what a user of the engine would write for a loop: the engine's model is read by the engine, its state
is set where it has one, and the result is an array that the caller owns, in the order of dynx. Quantities
that an engine does not compute are left out.
"""
