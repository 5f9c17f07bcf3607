"""Invalid shapes and poses are named."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dynx.distance import Hull, PlacedSolid, contact_points, distance, separation, support
from dynx.errors import ArgumentError, DTypeError, DynxError, NotFiniteError, RobotNotFoundError, ShapeError
from dynx.model.elements import Pose
from dynx.model.geometry import Box, HeightField, Mesh, Plane, Sphere

HERE = np.eye(4)
BALL, BRICK = Sphere(0.5), Box((1.0, 1.0, 1.0))
MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])

FAULTS: dict[str, tuple[Callable[[], object], type[DynxError], str]] = {
    "no shape": (lambda: distance("ball", HERE, BALL, HERE), ArgumentError, "shape_a is 'ball'"),  # type: ignore[arg-type]
    "not convex": (
        lambda: distance(HeightField(((0, 0), (0, 0)), (1, 1)), HERE, BALL, HERE),  # type: ignore[arg-type]
        ArgumentError,
        "wanted a Box",
    ),
    "two planes": (lambda: distance(Plane(), HERE, Plane(), HERE), ArgumentError, "both shapes are planes"),
    "NaN": (lambda: distance(BALL, np.full((4, 4), np.nan), BRICK, HERE), NotFiniteError, "T_a"),
    "size": (lambda: distance(BALL, HERE, BRICK, np.eye(3)), ShapeError, r"T_b has shape \(3, 3\)"),
    "mirrored": (lambda: distance(BALL, HERE, BRICK, MIRRORED), ArgumentError, "T_b is not a rigid"),
    "text": (lambda: distance(BALL, "here", BRICK, HERE), ArgumentError, "T_a is 'here'"),
    "complex": (lambda: distance(BALL, np.eye(4) * 1j, BRICK, HERE), DTypeError, "T_a has dtype complex"),
    "far": (lambda: distance(BALL, Pose((1e70, 0, 0)), BRICK, HERE), ArgumentError, "1e"),
    "no direction": (lambda: support(BRICK, HERE, [0, 0, 0]), ArgumentError, "direction is zero"),
    "no normal": (lambda: separation(BRICK, HERE, BALL, HERE, [0, 0]), ShapeError, "normal"),
    "no points": (lambda: Hull(np.zeros((0, 3))), ShapeError, "points of a hull"),
    "points in a plane": (lambda: Hull(np.zeros((5, 2))), ShapeError, r"points(\[| has)"),
    "points as text": (lambda: Hull(["a", "b"]), DTypeError, r"points(\[| has)"),  # type: ignore[arg-type]
    "points of NaN": (lambda: Hull([[0.0, np.nan, 0.0]]), NotFiniteError, r"points(\[| has)"),  # type: ignore[arg-type]
    "contact of a shape without a pose": (
        lambda: contact_points(PlacedSolid(BRICK), Plane(), 0.1),  # type: ignore[arg-type]
        ArgumentError,
        r"b is .*of type Plane; wanted a PlacedSolid",
    ),
    "contacts within a negative gap": (
        lambda: contact_points(PlacedSolid(BRICK), PlacedSolid(BALL), -1.0),
        ArgumentError,
        "within is -1; wanted a gap of at least 0",
    ),
    "contacts within no number": (
        lambda: contact_points(PlacedSolid(BRICK), PlacedSolid(BALL), np.nan),
        ArgumentError,
        "within is nan",
    ),
    "no file": (lambda: distance(Mesh("/nowhere.stl"), HERE, BALL, HERE), RobotNotFoundError, "nowhere"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_named(name: str) -> None:
    call, kind, words = FAULTS[name]
    with pytest.raises(kind, match=words):
        call()


def test_a_pose_may_be_a_pose() -> None:
    found = distance(BALL, Pose((0.0, 0.0, 2.0)), BRICK, Pose())
    assert found.distance == pytest.approx(1.0)


def test_only_the_normal_of_a_plane_has_a_support() -> None:
    assert support(Plane(), HERE, [0, 0, 2])[0] == 0.0
    assert support(Plane(), HERE, [0, 1, 2])[0] == np.inf
    assert separation(BALL, HERE, Plane(), HERE, [0, 1, 2]) == -np.inf
