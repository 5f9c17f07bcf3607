"""Options of a simulation of rigid bodies alone, without the joint dynamics of the description."""

from __future__ import annotations

from typing import Any

RIGID_BODIES: dict[str, Any] = {
    "joint_damping": False,
    "joint_friction": False,
    "joint_armature": False,
    "joint_springs": False,
}
"""Options of `simulate`, of batches and scenarios, of worlds and of observers."""
