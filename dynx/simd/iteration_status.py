"""Numbers by which a step tells how its iteration goes on. This module needs no compiler."""

RUNNING, GIVEN_UP, REACHED = 0.0, 1.0, 2.0
"""Values of ``status``."""

NO_RESTART = -1.0
"""Value of ``restart`` for a task that goes on."""
