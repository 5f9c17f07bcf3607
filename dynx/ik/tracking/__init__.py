"""Tracking of a path of poses by a continuous sequence of configurations.

`followers` solve one target after the other within bounds, `path` decides where that is not enough, and
`tracker` checks arguments, chooses the start and says why a sample is not reached.
"""

from dynx.ik.tracking.path import TrackResult, TrackStatus
from dynx.ik.tracking.tracker import track

__all__ = ["TrackResult", "TrackStatus", "track"]
