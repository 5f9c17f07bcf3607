"""Addresses of engine calls: on the whole robot, or on one of its joints.

The id of a call (a key of `LoadedRobot.CALLS`) is the call on the whole robot. ``id@joint`` is the same call
on one joint, with which the effect of that joint alone is measured.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator


def call_on_joint(call: str, joint: str) -> str:
    """Return the address of a call on one joint."""
    return f"{call}@{joint}"


def called_joints(calls: Collection[str], call: str, joints: Collection[str]) -> Iterator[str]:
    """Yield those of the `joints` on which `call` is made: all of them by a call on the whole robot."""
    return (joint for joint in joints if call in calls or call_on_joint(call, joint) in calls)
