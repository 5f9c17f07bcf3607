"""Statements on a robot in SDF for which the format has no element: those of dynx, and two of Drake's.

Their names have a prefix, as the format provides for elements of one program; others leave them alone.
"""

from __future__ import annotations

NAMESPACE = "https://sdformat.org/custom/dynx"
"""Namespace of the prefix ``dynx``, a name and no address."""

NAME = "dynx:name"
"""Name of a model, link, joint or frame that the format does not accept, because it is reserved or that of
another part."""

HOLD = "dynx:base"
"""Mark of the fixed joint that holds the root link in the world: the robot has no such joint, and the pose of
its base is that of the link."""

LOCKED = "dynx:locked"
"""Position [rad or m] at which a joint was locked, which is fixed in SDF."""

LIMITS = {each: f"dynx:{each}" for each in ("lower", "upper", "velocity", "effort")}
"""Limits [rad or m, rad/s or m/s, N m or N] that SDF reads as none: from 1e16 on, or negative ones of speed
or effort."""

ROTOR_INERTIA, GEAR_RATIO = "drake:rotor_inertia", "drake:gear_ratio"
"""Rotor inertia [kg m^2 or kg] and gear ratio of Drake: the armature is the inertia times the ratio squared,
for a joint of one axis."""
