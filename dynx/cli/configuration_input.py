"""From the words of a command to a model, a backend, a frame and the numbers of one sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from dynx.backends import Backend
    from dynx.model import Model
    from dynx.model.model import Base
    from dynx.spatial.scalar import Floats

Numbers = Sequence[float] | Mapping[str, float] | None
"""What an option such as ``--q`` gave: a list, values by joint, or nothing."""


def open_backend(robot: str, base: Base, lock: tuple[tuple[str, float], ...], name: str | None) -> Backend:
    """The backend `name` of a robot; None means Pinocchio if it is installed, else `reference`."""
    from dynx.backends.registry import backend
    from dynx.errors import NotInstalledError
    from dynx.model.loading import load

    model = load(robot, base=base, lock=dict(lock))
    if name is not None:
        return backend(name, model)
    try:
        return backend("pinocchio", model)
    except NotInstalledError:
        return backend("reference", model)


def configuration(model: Model, given: Numbers) -> Any:
    """q: as given, or neutral with the joints that are given by name put in."""
    return _filled(model, given, model.neutral(), 7 if model.floating else 0)


def velocity(model: Model, given: Numbers) -> Any:
    """v, a or tau: as given, or zero with the joints that are given by name put in."""
    import numpy as np

    return _filled(model, given, np.zeros(model.nv), 6 if model.floating else 0)


def default_frame(model: Model) -> str:
    """The end of the longest chain of moving joints; of several, the last in `frame_names`."""
    moving, joints = {model.root: 0}, {model.root: 0}
    for joint in model.joints:
        moving[joint.child] = moving[joint.parent] + joint.moves
        joints[joint.child] = joints[joint.parent] + 1
    order = {link.name: k for k, link in enumerate(model.links)}
    return max(order, key=lambda link: (moving[link], joints[link], order[link]))


def _filled(model: Model, given: Numbers, default: Floats, offset: int) -> Any:
    from dynx.errors import UnknownNameError, nearest, shown

    if given is None:
        return default
    if not isinstance(given, Mapping):
        return list(given)
    for name, value in given.items():
        if name not in model.joint_names:
            raise UnknownNameError(
                f"no coordinate {shown(name)} in {model.name}{nearest(name, model.joint_names)}"
            )
        default[offset + model.joint_names.index(name)] = value
    return default
