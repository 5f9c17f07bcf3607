"""`Randomization`: the parameters that an environment draws for each episode (domain randomisation)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from dynx.envs.randomization.distribution import (
    ANY,
    NOT_NEGATIVE,
    POSITIVE,
    Distribution,
    Range,
    is_distribution,
    read_distribution,
)
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown

Ranges = Range | Mapping[str, Range]
"""One distribution for all parts, of which an episode draws one number; or one for each named part."""

PAYLOAD_FIELDS = ("frame", "mass", "center")
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Randomization:
    """Parameters that each episode draws; None for those that keep the values of the task.

    A distribution is a number, ``(low, high)`` for uniform numbers, ``{"log_uniform": (low, high)}``, or
    ``{"normal": (mean, deviation)}`` clamped at three deviations. A mapping from names to distributions draws
    a number for each part that it names.

    The robot that moves has the drawn parameters; the task computes with the nominal ones (a torque of
    gravity, for example), as a controller does. Raises ArgumentError (and its kinds) for numbers that no
    robot has.
    """

    mass_scale: Ranges | None = None
    """Factor on mass and inertia of links, by name; in worlds also of bodies."""
    payload: Mapping[str, Any] | None = None
    """Point mass fixed to a frame: ``{"frame": "tool0", "mass": (0.0, 2.0), "center": (0.0, 0.0, 0.05)}``,
    with a distribution of the mass [kg] and one of each coordinate in the frame [m]."""
    joint_damping: Ranges | None = None
    """Viscous damping of joints, by name [N m s/rad or N s/m]."""
    joint_friction: Ranges | None = None
    """Dry friction of joints, by name [N m or N]."""
    friction_scale: Ranges | None = None
    """Factor on the coefficients of contact friction of links and bodies, by name; in worlds only."""
    delay: Range | None = None
    """Time from an action until it acts [s]."""
    observation_noise: Range | Mapping[int | str, Range] | None = None
    """Standard deviation of Gaussian noise on observations: of all entries, or by the number of the entry."""
    action_noise: Range | Mapping[int | str, Range] | None = None
    """Standard deviation of Gaussian noise on the numbers of actions, which are clamped to their space."""

    def __post_init__(self) -> None:
        for each in fields(self):
            self.distributions(each.name)
        if not any(getattr(self, each.name) is not None for each in fields(self)):
            known = ", ".join(each.name for each in fields(self))
            raise ArgumentError(f"a randomization names no parameter; known: {known}")

    @classmethod
    def read(cls, given: Randomization | Mapping[str, Any]) -> Randomization:
        """Return a randomization given itself, or as a mapping of its fields.

        Raises UnknownNameError for a field that does not exist, with the nearest one.
        """
        if isinstance(given, Randomization):
            return given
        if not isinstance(given, Mapping):
            raise ArgumentError(
                f"randomize is {shown(given)}; wanted a dict such as {{'mass_scale': (0.8, 1.2)}}"
            )
        known = [each.name for each in fields(cls)]
        for name in given:
            if name not in known:
                raise UnknownNameError(f"randomize has no parameter {shown(name)}{nearest(str(name), known)}")
        return cls(**given)

    def distributions(self, name: str) -> dict[str | None, Distribution]:
        """Return the distributions of a field by the name of the part, which is None for all parts."""
        given = getattr(self, name)
        if given is None:
            return {}
        if name == "payload":
            return _payload(given)
        valid = POSITIVE if name == "mass_scale" else NOT_NEGATIVE
        if is_distribution(given) or name == "delay":
            return {None: read_distribution(name, given, valid)}
        if not given:
            raise ArgumentError(f"{name} names no part; wanted a distribution, or one for each of some names")
        return {
            str(part): read_distribution(f"{name} of {shown(part)}", each, valid)
            for part, each in given.items()
        }

    @property
    def payload_frame(self) -> str | None:
        """Frame to which the payload is fixed."""
        return None if self.payload is None else str(self.payload["frame"])


def _payload(given: Any) -> dict[str | None, Distribution]:
    """Return the distributions of the mass and of the coordinates x, y and z of a payload."""
    if not isinstance(given, Mapping):
        raise ArgumentError(f"payload is {shown(given)}; wanted {{'frame': name, 'mass': (low, high)}}")
    for name in given:
        if name not in PAYLOAD_FIELDS:
            raise UnknownNameError(f"payload has no {shown(name)}{nearest(str(name), PAYLOAD_FIELDS)}")
    for name in PAYLOAD_FIELDS[:2]:
        if name not in given:
            raise ArgumentError(f"payload has no {name}: {shown(given)}")
    if not isinstance(given["frame"], str):
        raise ArgumentError(
            f"the frame of the payload is {shown(given['frame'])}; wanted the name of a frame"
        )
    center = given.get("center", (0.0, 0.0, 0.0))
    if not isinstance(center, Sequence) or isinstance(center, str) or len(center) != len(AXES):
        raise ArgumentError(f"the center of the payload is {shown(center)}; wanted three numbers or ranges")
    found: dict[str | None, Distribution] = {
        "mass": read_distribution("the mass of the payload", given["mass"])
    }
    for axis, each in zip(AXES, center, strict=True):
        found[axis] = read_distribution(f"{axis} of the payload", each, ANY)
    return found
