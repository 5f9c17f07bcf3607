"""Velocity inverse kinematics as a bounded quadratic programme.

`tasks` and `limits` state the programme, `programme` sets it up, and `library` is the only import of its
solver.
"""

from dynx.ik.velocity.programme import VelocityResult, velocity_ik
from dynx.ik.velocity.tasks import VelocityTask

__all__ = ["VelocityResult", "VelocityTask", "velocity_ik"]
