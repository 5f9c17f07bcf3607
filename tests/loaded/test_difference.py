"""The model difference lists every deviation, and nothing that only the notation distinguishes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.loaded import LoadedInertial, LoadedJoint, LoadedModel
from dynx.loaded.difference import ROUNDING, Deviation, model_difference
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Model, Pose
from dynx.model.mechanism import build_mechanism
from dynx.model.tree import STANDARD_GRAVITY
from dynx.spatial.so3 import rotation_from_rpy, skew
from tests.loaded.files import TILTED, file_robots

ENGINE = "some engine"
BODY = Inertial(2.0, Pose((0.1, 0.2, 0.3), (0.3, 0.2, 0.1)), 0.2, 0.01, 0.02, 0.3, 0.03, 0.4)


def exact(model: Model) -> LoadedModel:
    """Return the description by an engine that loads the file as dynx does and merges no links."""
    links = {}
    for link in model.links:
        inertial = link.inertial or Inertial()
        R = rotation_from_rpy(np.array(inertial.origin.rpy))
        tensor = np.asarray(R @ inertial.tensor @ R.T)
        links[link.name] = LoadedInertial(inertial.mass, np.array(inertial.origin.xyz), tensor)
    joints = {
        joint.name: LoadedJoint(
            joint.type,
            joint.origin.matrix,
            np.array(joint.axis),
            (joint.limits.lower, joint.limits.upper),
            joint.limits.velocity,
            joint.limits.effort,
            joint.dynamics.damping,
            joint.dynamics.friction,
            joint.dynamics.armature,
        )
        for joint in model.joints
        if joint.moves
    }
    return LoadedModel(ENGINE, links, joints, np.eye(4), np.array(STANDARD_GRAVITY))


def with_merged_links(model: Model) -> LoadedModel:
    """Return the description by an engine that merges links connected by fixed joints."""
    mechanism = build_mechanism(model)
    inertials = {}
    places = {frame.name: frame.body for frame in mechanism.frames[: len(model.links)]}
    for body, inertia in enumerate([*(each.inertia for each in mechanism.bodies), mechanism.root]):
        number = body if body < len(mechanism.bodies) else -1
        first, *others = [link.name for link in model.links if places[link.name] == number]
        mass = float(inertia.mass)
        center = inertia.first_moment / mass if mass else np.zeros(3)
        arm = skew(center)
        tensor = inertia.rotational_inertia + mass * (arm @ arm)
        inertials[first] = LoadedInertial(mass, np.asarray(center), np.asarray(tensor), tuple(others))
    return replace(exact(model), links=inertials)


def rows(model: Model, engine: LoadedModel) -> list[tuple[str, str, str]]:
    return [(row.part, row.name, row.property) for row in model_difference(model, [engine])]


def robot() -> Model:
    links = [Link(name, BODY) for name in ("base", "arm", "hand", "tool")]
    limits = Limits(-1.0, 2.0, 3.0, 4.0)
    joints = [
        Joint("turn", "revolute", "base", "arm", Pose((0.1, 0.2, 0.3), (0.1, 0.2, 0.3)), limits=limits),
        Joint("slide", "prismatic", "arm", "hand", limits=limits, dynamics=JointDynamics(0.1, 0.2, 0.3)),
        Joint("weld", "fixed", "hand", "tool", Pose((0.4, 0.5, 0.6), (0.6, 0.5, 0.4))),
    ]
    return Model.build("robot", links, joints, base="floating", gravity=TILTED)


@given(file_robots())
def test_equal_models_do_not_deviate(model: Model) -> None:
    assert rows(model, exact(model)) == []


@given(file_robots())
def test_merged_links_are_compared_by_merged_inertia(model: Model) -> None:
    assert rows(model, with_merged_links(model)) == []


def _link(name: str, **changes: Any) -> Callable[[LoadedModel], LoadedModel]:
    return lambda engine: replace(
        engine, links={**engine.links, name: replace(engine.links[name], **changes)}
    )


def _joint(name: str, **changes: Any) -> Callable[[LoadedModel], LoadedModel]:
    return lambda engine: replace(
        engine, joints={**engine.joints, name: replace(engine.joints[name], **changes)}
    )


def _without_link(name: str) -> Callable[[LoadedModel], LoadedModel]:
    return lambda engine: replace(engine, links={k: x for k, x in engine.links.items() if k != name})


def _without_joint(name: str) -> Callable[[LoadedModel], LoadedModel]:
    return lambda engine: replace(engine, joints={k: x for k, x in engine.joints.items() if k != name})


def _shifted(by: tuple[float, float, float]) -> Any:
    T = robot().joint("turn").origin.matrix.copy()
    T[:3, 3] += by
    return T


def _turned() -> Any:
    T = robot().joint("turn").origin.matrix.copy()
    T[:3, :3] = T[:3, :3] @ rotation_from_rpy(np.array([0.0, 0.0, 1e-9]))
    return T


DEVIATIONS: list[tuple[Callable[[LoadedModel], LoadedModel], tuple[str, str, str]]] = [
    (_link("arm", mass=2.000001), ("link", "arm", "mass")),
    (_link("arm", center=np.array([0.1, 0.2, 0.3 + 1e-9])), ("link", "arm", "center")),
    (_link("arm", inertia=np.zeros((3, 3))), ("link", "arm", "inertia")),
    (_without_link("arm"), ("link", "arm", "existence")),
    (_without_joint("turn"), ("joint", "turn", "existence")),
    (_joint("turn", type="prismatic"), ("joint", "turn", "type")),
    (_joint("turn", type="floating"), ("joint", "turn", "type")),
    (_joint("turn", placement=_shifted((0.0, 1e-9, 0.0))), ("joint", "turn", "position")),
    (_joint("turn", placement=_turned()), ("joint", "turn", "rotation")),
    (_joint("turn", axis=np.array([-1.0, 0.0, 0.0])), ("joint", "turn", "axis")),
    (_joint("turn", axis=np.array([1.0000001, 0.0, 0.0])), ("joint", "turn", "axis")),
    (_joint("turn", limits=(-1.5, 2.0)), ("joint", "turn", "lower")),
    (_joint("turn", limits=(-1.0, np.inf)), ("joint", "turn", "upper")),
    (_joint("turn", velocity=0.0), ("joint", "turn", "velocity")),
    (_joint("turn", effort=np.inf), ("joint", "turn", "effort")),
    (_joint("slide", damping=0.0), ("joint", "slide", "damping")),
    (_joint("slide", friction=0.0), ("joint", "slide", "friction")),
    (_joint("slide", armature=0.0), ("joint", "slide", "armature")),
    (lambda engine: replace(engine, base_frame=_shifted((0.0, 0.0, 0.0))), ("base", "base", "position")),
    (lambda engine: replace(engine, gravity=np.zeros(3)), ("gravity", "gravity", "default")),
    (
        lambda engine: replace(engine, links={**engine.links, "more": engine.links["arm"]}),
        ("link", "more", "existence"),
    ),
    (
        lambda engine: replace(engine, joints={**engine.joints, "more": engine.joints["turn"]}),
        ("joint", "more", "existence"),
    ),
]


@pytest.mark.parametrize(("change", "row"), DEVIATIONS, ids=[f"{d[1][1]}-{d[1][2]}" for d in DEVIATIONS])
def test_each_deviation_is_listed_and_no_other(
    change: Callable[[LoadedModel], LoadedModel], row: tuple[str, str, str]
) -> None:
    engine = change(exact(robot()))
    found = rows(robot(), engine)
    for each in model_difference(robot(), [engine]):
        assert each.engine == ENGINE
        assert each.file != each.engine_value
        if each.property == "existence":
            assert (bool(each.file), bool(each.engine_value)) == (each.name != "more", each.name == "more")
    if row == ("base", "base", "position"):
        assert found == [row, ("base", "base", "rotation")]
    else:
        assert found == [row]


@given(st.data())
def test_a_mass_that_differs_by_more_than_rounding_is_listed(data: st.DataObject) -> None:
    model = data.draw(file_robots("floating", solvable=True))
    name = data.draw(st.sampled_from([link.name for link in model.links]))
    engine, off = exact(model), data.draw(st.sampled_from((4.0, -4.0, 1e3, 1e11)))
    mass = engine.links[name].mass * (1.0 + off * ROUNDING)
    assert rows(model, _link(name, mass=mass)(engine)) == [("link", name, "mass")]
    mass = engine.links[name].mass * (1.0 + 0.25 * ROUNDING)
    assert rows(model, _link(name, mass=mass)(engine)) == []


def test_nan_deviates() -> None:
    for value in (float("nan"), float("inf")):
        assert rows(robot(), _link("arm", mass=value)(exact(robot()))) == [("link", "arm", "mass")]
        inertia = np.diag([0.2, 0.3, value])
        assert rows(robot(), _link("arm", inertia=inertia)(exact(robot()))) == [("link", "arm", "inertia")]


def test_a_deviation_of_a_light_link_is_listed() -> None:
    feather = Inertial(1e-15, BODY.origin, ixx=1e-15, iyy=1e-15, izz=1e-15)
    links = tuple(replace(each, inertial=feather) if each.name == "arm" else each for each in robot().links)
    model = replace(robot(), links=links)
    assert rows(model, exact(model)) == []
    found = rows(model, _link("arm", mass=1.5e-15, inertia=np.zeros((3, 3)))(exact(model)))
    assert found == [("link", "arm", "mass"), ("link", "arm", "inertia")]


SAME = [
    (Limits(), {"limits": (-1e9, 1e9), "velocity": 0.0, "effort": 0.0}),
    (Limits(), {"limits": (-np.inf, np.inf), "velocity": np.inf, "effort": 1e10}),
    (Limits(-1e16, 1e16, 5.0, 5.0), {"limits": (-1e10, np.inf)}),
    (Limits(-1.0, 1.0, 5.0, 5.0), {"velocity": None, "effort": None, "limits": None, "damping": None}),
    (Limits(-1.0, 1.0, 5.0, 5.0), {"placement": None, "axis": None, "armature": None, "friction": None}),
]


@pytest.mark.parametrize(("limits", "changes"), SAME)
def test_equivalent_notation_is_no_deviation(limits: Limits, changes: dict[str, Any]) -> None:
    joints = [replace(joint, limits=limits) for joint in robot().joints]
    model = replace(robot(), joints=tuple(joints))
    assert rows(model, _joint("turn", **changes)(exact(model))) == []


def test_a_continuous_joint_may_be_revolute_without_limits() -> None:
    joints = (replace(robot().joints[0], type="continuous", limits=Limits()), *robot().joints[1:])
    model = replace(robot(), joints=joints)
    for limits in ((0.0, 0.0), (0.0, -1.0), (-np.inf, np.inf), None):
        assert rows(model, _joint("turn", type="revolute", limits=limits)(exact(model))) == []
    found = rows(model, _joint("turn", type="revolute", limits=(-1.0, 1.0))(exact(model)))
    assert found == [("joint", "turn", "lower"), ("joint", "turn", "upper")]


def test_a_deviation_among_merged_links_is_that_of_the_merged_link() -> None:
    model = robot()
    engine = with_merged_links(model)
    assert engine.links["hand"].merged == ("tool",)
    heavier = _link("hand", mass=engine.links["hand"].mass + 1.0)(engine)
    assert rows(model, heavier) == [("link", "hand", "mass")]


def test_a_merged_link_that_is_also_listed_alone_is_compared_once() -> None:
    # As Pinocchio does: the merged link, and the link on the fixed joint by itself.
    model = robot()
    spoiled = replace(
        model,
        links=tuple(
            replace(link, inertial=Inertial()) if link.name == "tool" else link for link in model.links
        ),
    )
    engine = with_merged_links(spoiled)
    engine = replace(engine, links={**engine.links, "tool": exact(spoiled).links["tool"]})
    assert rows(model, engine) == [("link", "tool", "mass"), ("link", "tool", "inertia")]


def test_the_root_of_a_fixed_base_is_left_out() -> None:
    model = robot().with_base("fixed")
    nothing = LoadedInertial(0.0, np.zeros(3), np.zeros((3, 3)))
    assert rows(model, _link("base", **vars(nothing))(exact(model))) == []
    assert rows(model, _without_link("base")(exact(model))) == []
    assert rows(robot(), _without_link("base")(exact(robot()))) == [("link", "base", "existence")]


def test_values_are_plain_numbers_and_none_for_unlimited() -> None:
    engine = _joint("turn", limits=(-np.inf, 2.0), axis=np.array([0.0, 1.0, 0.0]))(exact(robot()))
    first, second = model_difference(robot(), [engine, engine])[:2]
    assert first == Deviation(ENGINE, "joint", "turn", "axis", [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    assert second == Deviation(ENGINE, "joint", "turn", "lower", -1.0, None)
    assert len(model_difference(robot(), [engine, engine])) == 4
