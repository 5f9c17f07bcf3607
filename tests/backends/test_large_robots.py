"""What it takes to open a backend grows with the number of joints, not with its square."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from dataclasses import replace

import pytest

import dynx
from dynx.backends import backend, installed_backends
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.errors import EngineLimitError
from dynx.model import Inertial, Joint, Link, Model
from dynx.model.mechanism import Body
from dynx.rbd.base_parameters import align_frames

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
