"""Tracking of a path of poses by a continuous sequence of configurations.

`descent` solves one target after the other within bounds, `path` decides where that is not enough, `reason`
says why a sample is not reached, and `tracker` checks arguments and chooses the start.
"""

from dynx.ik.tracking.descent import Followed, Follower, StepBounds
from dynx.ik.tracking.result import TrackResult, TrackStatus
from dynx.ik.tracking.tracker import track

__all__ = ["Followed", "Follower", "StepBounds", "TrackResult", "TrackStatus", "track"]
