"""What it takes to open a backend grows with the number of joints, not with its square."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
import dynx.model.mechanism as model_mechanism
from dynx.backends import backend, installed_backends
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.compiled.simplification import _zero_rounding_residue, simplify_mechanism
from dynx.errors import EngineLimitError
from dynx.model import Inertial, Joint, Link, Model
from dynx.model.mechanism import Body
from dynx.rbd.base_parameters import align_frames
from dynx.spatial.inertia import RigidInertia

JOINTS = 1000


def chain() -> dynx.Model:
    link = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    links = "".join(f'<link name="l{k}">{link}</link>' for k in range(JOINTS + 1))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="l{k}"/><child link="l{k + 1}"/>'
        '<axis xyz="0 0 1"/><dynamics damping="0.1" friction="0.2" armature="0.3"/></joint>'
        for k in range(JOINTS)
    )
    return dynx.load(f'<robot name="chain">{links}{joints}</robot>')


def test_joint_dynamics_of_many_joints_take_no_square_matrix() -> None:
    model = chain()
    model.mechanism  # noqa: B018  # built once for everything
    tracemalloc.start()
    try:
        terms = JointDynamicsTerms(model)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < JOINTS**2
    assert terms.armature_torque([2.0] * JOINTS).tolist() == [0.6] * JOINTS


def test_frames_of_many_joints_are_aligned_in_few_passes() -> None:
    passes = 0

    class Counted(tuple[Body, ...]):
        def __iter__(self) -> Iterator[Body]:
            nonlocal passes
            passes += 1
            return super().__iter__()

    mechanism = chain().mechanism
    aligned = align_frames(replace(mechanism, bodies=Counted(mechanism.bodies)))
    assert len(aligned.bodies) == JOINTS
    assert passes <= 3


BOUNDED = ("pinocchio", "pybullet", "mujoco")
"""Engines with a bound on the number of joints."""


def robot(joints: int, *, star: bool, floating: bool) -> Model:
    links = [Link(f"link{k}", Inertial(1.0, ixx=0.1, iyy=0.1, izz=0.1)) for k in range(joints + 1)]
    tree = [
        Joint(f"joint{k}", "revolute", "link0" if star else f"link{k}", f"link{k + 1}") for k in range(joints)
    ]
    return Model.build("large", links, tree, base="floating" if floating else "fixed")


@pytest.mark.parametrize("name", [name for name in BOUNDED if name in installed_backends()])
@pytest.mark.parametrize("star", [False, True])
@pytest.mark.parametrize("floating", [False, True])
def test_a_robot_beyond_a_bound_is_refused_before_its_links_are_merged(
    name: str, star: bool, floating: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = robot(1200, star=star, floating=floating)

    def merged(*_: object) -> None:
        raise AssertionError("the links were merged")

    monkeypatch.setattr("dynx.model.model.build_mechanism", merged)
    with pytest.raises(EngineLimitError, match=r"^large has 120\d .* at most \d+"):
        backend(name, model)


def test_poses_and_inertias_of_many_links_are_computed_together(monkeypatch: pytest.MonkeyPatch) -> None:
    counts: Counter[str] = Counter()

    def counted(name: str, function: Any) -> Any:
        def call(*arguments: Any) -> Any:
            counts[name] += 1
            return function(*arguments)

        return call

    for name in ("rotation_from_rpy", "inertia_about_origin"):
        monkeypatch.setattr(model_mechanism, name, counted(name, getattr(model_mechanism, name)))
    monkeypatch.setattr(RigidInertia, "transform", counted("transform", RigidInertia.transform))
    mechanism = robot(300, star=False, floating=True).mechanism
    assert counts == {"rotation_from_rpy": 3, "inertia_about_origin": 1, "transform": 1}
    simplified = simplify_mechanism(mechanism)
    assert counts["transform"] == 2
    assert len(simplified.bodies) == 300


def test_rotations_without_rounding_residues_are_kept_as_they_are() -> None:
    turned = dynx.load("ur5").mechanism
    kept = _zero_rounding_residue(turned)
    again = _zero_rounding_residue(kept)
    assert all(a is b for a, b in zip(kept.bodies, again.bodies, strict=True))
    assert all(a is b for a, b in zip(kept.frames, again.frames, strict=True))
    for part in kept.bodies:
        assert ((part.R == 0.0) | (abs(part.R) >= 0.5 * np.finfo(float).eps)).all()
