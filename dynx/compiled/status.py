"""Reasons why the steps of a closed loop end, compiled or on floats. This module needs no compiler."""

from __future__ import annotations

from enum import IntFlag


class Status(IntFlag):
    """Reasons why the steps of a lane ended; `DONE`: all were made."""

    DONE = 0
    TORQUE = 1
    """The torque of the controller is not finite."""
    DIVERGED = 2
    """The velocity after the step is not finite or too large to be meaningful."""
    AT_LIMIT = 4
    """A joint passed a position limit, to which it is to be stopped before the next step."""
    UNSETTLED = 8
    """It is not settled which joints stick: the step is to be repeated with corrected modes."""
