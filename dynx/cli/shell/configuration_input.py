"""From the words of a command to a model, a backend, a frame and the numbers of one sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from dynx.cli.shell.exits import one_line

if TYPE_CHECKING:
    from dynx.backends import Backend
    from dynx.model import Model
    from dynx.model.model import Base
    from dynx.spatial.scalar import Floats

Numbers = Sequence[float] | Mapping[str, float] | None
"""What an option such as ``--q`` gave: a list, values by joint, or nothing."""

_LISTED_NAMES = 8
"""Coordinates named in the message about a wrong count."""


def open_backend(
    robot: str, base: Base, lock: tuple[tuple[str, float], ...], backend_name: str | None
) -> Backend:
    """The backend of a robot by its name; None means Pinocchio if it is installed, else `reference`."""
    from dynx.backends.registry import backend
    from dynx.errors import NotInstalledError
    from dynx.model.loading import load

    model = load(robot, base=base, lock=dict(lock))
    if backend_name is not None:
        return backend(backend_name, model)
    try:
        return backend("pinocchio", model)
    except NotInstalledError:
        return backend("reference", model)


def configuration(model: Model, given: Numbers, option: str = "--q", default: Floats | None = None) -> Floats:
    """q: as given, or `default` (neutral if None) with the joints that are given by name put in."""
    from dynx.model.configuration import checked_q

    base = ["x", "y", "z", "qx", "qy", "qz", "qw"] if model.floating else []
    start = model.neutral() if default is None else default.copy()
    return checked_q(model, _filled(model, given, start, base, option), option)


def velocity(model: Model, given: Numbers, option: str) -> Floats:
    """v, a or tau: as given to `option`, or zero with the joints that are given by name put in."""
    import numpy as np

    from dynx.model.configuration import checked_array

    filled = _filled(model, given, np.zeros(model.nv), _base_velocity(model), option)
    return checked_array(option, filled, model.nv)


def velocity_names(model: Model) -> list[str]:
    """What each entry of v, a and tau belongs to."""
    return [*_base_velocity(model), *model.joint_names]


def chosen_frame(model: Model, given: str | None) -> str:
    """The frame that ``--frame`` gave, or else the default one."""
    return default_frame(model) if given is None else given


def default_said(frame: str) -> str:
    """The line that says which frame was taken when none was given."""
    return f"frame {one_line(frame)} ends the longest chain of moving joints; --frame chooses another"


def default_frame(model: Model) -> str:
    """The end of the longest chain of moving joints; of several, the last in `frame_names`."""
    moving, joints = {model.root: 0}, {model.root: 0}
    for joint in model.joints:
        moving[joint.child] = moving[joint.parent] + joint.moves
        joints[joint.child] = joints[joint.parent] + 1
    order = {link.name: k for k, link in enumerate(model.links)}
    return max(order, key=lambda link: (moving[link], joints[link], order[link]))


def _base_velocity(model: Model) -> list[str]:
    return ["base vx", "base vy", "base vz", "base wx", "base wy", "base wz"] if model.floating else []


def _filled(model: Model, given: Numbers, default: Floats, base: Sequence[str], option: str) -> Floats:
    """What `option` gave, in an array like `default`, whose first entries are those of the `base`."""
    import numpy as np

    from dynx.errors import ArgumentError

    if given is None:
        return default
    if isinstance(given, Mapping):
        for name, value in given.items():
            default[len(base) + _joint_number(model, name, option)] = value
        return default
    if len(given) != len(default):
        names = [*base, *map(one_line, model.joint_names)]
        listed = ", ".join(names[:_LISTED_NAMES]) + (", ..." if len(names) > _LISTED_NAMES else "")
        numbers = "1 number" if len(given) == 1 else f"{len(given)} numbers"
        needed = f"{len(names)}: {listed}" if names else "none"
        raise ArgumentError(f"{option} has {numbers}; {one_line(model.name)} needs {needed}")
    return np.array(given, dtype=np.float64)


def _joint_number(model: Model, name: str, option: str) -> int:
    """Position in `joint_names`, or an error that says why there is none."""
    from dynx.errors import UnknownNameError, nearest, shown

    if name in model.joint_names:
        return model.joint_names.index(name)
    if all(joint.name != name for joint in model.joints):
        raise UnknownNameError(
            f"{option}: {model.name} has no joint {shown(name)}{nearest(name, model.joint_names)}"
        )
    try:
        return model.coordinate_index(name)
    except UnknownNameError as error:
        raise UnknownNameError(f"{option}: {error}") from error
