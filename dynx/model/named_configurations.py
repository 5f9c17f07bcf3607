"""Named configurations of a robot: those of its description, such as keyframes of MJCF, and others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, UnknownNameError, nearest, shown
from dynx.model.configuration import checked_q, neutral
from dynx.model.model import Model
from dynx.model.stated_parts import NamedConfiguration
from dynx.model.tree import Tree
from dynx.spatial.scalar import Floats


class _Configurations(dict[str, Floats]):
    """Configurations of a robot, with an error that lists the names."""

    def __init__(self, robot: str, nq: int) -> None:
        super().__init__()
        self._robot, self._none = robot, f"; its description has none; wanted {nq} numbers"

    def __missing__(self, name: object) -> Floats:
        known = f"; it has {', '.join(map(shown, list(self)[:8]))}" if self else self._none
        near = nearest(name, self) if isinstance(name, str) else ""
        raise UnknownNameError(f"no configuration {shown(name)} of {self._robot}{near or known}")


def named_configurations(tree: Tree) -> Mapping[str, Floats]:
    """Return the named configurations q (nq,) of a robot, read-only, by their names.

    Raises UnknownNameError for a position of a joint that the robot has not.
    """
    found = _Configurations(tree.name, tree.nq)
    for each in tree.stated_configurations or ():
        found[each.name] = coordinates_of(tree, each)
        found[each.name].setflags(write=False)
    return MappingProxyType(found)


def initial_configuration(tree: Tree) -> Floats:
    """Return the configuration q (nq,) in which the description of a robot places it, read-only."""
    q = coordinates_of(tree, tree.stated_initial or NamedConfiguration(""))
    q.setflags(write=False)
    return q


def coordinates_of(tree: Tree, configuration: NamedConfiguration) -> Floats:
    """Return q (nq,) of a configuration; what it does not state is neutral.

    Joints without a coordinate, which are locked or follow another one, keep the position that the model
    gives them. Raises UnknownNameError for a position of a joint that the robot has not.
    """
    q, own = neutral(tree), set(tree.joint_names)
    if tree.floating and configuration.base is not None:
        q[:7] = configuration.base
    for name, position in configuration.positions:
        if name in own:
            first = tree.position_index(name)
            q[first : first + len(position)] = position
        else:
            tree.joint(name)
    return q


def with_configuration(model: Model, name: str, q: ArrayLike) -> Model:
    """Return a robot with one more named configuration `q` (nq,); see `Model.with_configuration`."""
    if not isinstance(name, str) or not name:
        raise ArgumentError(f"a configuration's name is {shown(name)}; wanted a str that is not empty")
    if name in model.configurations:
        raise ArgumentError(f"configuration {shown(name)} exists already in {model.name}")
    q = checked_q(model, q)
    if q.ndim != 1:
        raise ShapeError(f"q has shape {q.shape}; wanted one configuration ({model.nq},)")
    positions = []
    for joint in model.coordinate_joints:
        first = model.position_index(joint.name)
        positions.append((joint.name, tuple(q[first : first + joint.n_positions].tolist())))
    base = tuple(q[:7].tolist()) if model.floating else None
    added = NamedConfiguration(name, tuple(positions), base)
    return replace(model, stated_configurations=(*(model.stated_configurations or ()), added))
