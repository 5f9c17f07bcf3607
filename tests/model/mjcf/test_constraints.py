"""Tendons, equality constraints and gravity compensation of MJCF as data: what MuJoCo makes of a file, and of
the file that dynx writes of the model."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import DescriptionError
from dynx.model import Model, StatedEquality, StatedGravityCompensation, StatedTendon
from dynx.model.conversion import ROUNDING, convert, robot_differences
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from tests.model.mjcf.models import models
from tests.model.random_numbers import Draw, lengths, numbers, vector

mujoco = pytest.importorskip("mujoco")


@st.composite
def tendons(draw: Draw, joints: list[str], name: str) -> str:
    chosen = draw(st.lists(st.sampled_from(joints), min_size=1, max_size=3, unique=True))
    text = f'<fixed name="{name}"' + draw(st.sampled_from(["", ' class="stiff"']))
    if draw(st.booleans()):
        text += f' stiffness="{draw(lengths)}"'
    if draw(st.booleans()):
        ends = sorted(draw(st.lists(numbers, min_size=1, max_size=2)))
        text += f' springlength="{" ".join(map(str, ends))}"'
    for attribute in ("damping", "frictionloss", "armature"):
        if draw(st.booleans()):
            text += f' {attribute}="{draw(lengths)}"'
    if draw(st.booleans()):
        text += ' range="-0.2 0.4"' + draw(st.sampled_from(["", ' limited="false"']))
    if draw(st.booleans()):
        text += ' actuatorfrcrange="-3 4"'
    terms = "".join(f'<joint joint="{each}" coef="{draw(numbers)}"/>' for each in chosen)
    return f"{text}>{terms}</fixed>"


@st.composite
def equalities(draw: Draw, parts: dict[str, list[str]], name: str) -> str:
    pairs = {kind: names for kind, names in parts.items() if len(names) > 1}
    tag = draw(st.sampled_from([*(["joint"] * ("joint" in pairs)), "connect", "weld", "tendon"]))
    text = f'<{tag} name="{name}"' + draw(st.sampled_from(["", ' class="stiff"', ' solref="0.1 0.9"']))
    text += draw(st.sampled_from(["", "", ' active="false"', ' solimp="0.8 0.9"']))
    if tag in ("joint", "tendon"):
        one, *other = draw(st.permutations(parts[tag]))[: draw(st.integers(1, 2))]
        text += f' {tag}1="{one}"' + "".join(f' {tag}2="{each}"' for each in other)
        if draw(st.booleans()):
            text += f' polycoef="{draw(vector(draw(st.integers(1, 5))))}"'
        return f"{text}/>"
    kind = draw(st.sampled_from(["body", *(["site"] * ("site" in pairs))]))
    if kind == "site":
        one, other = draw(st.permutations(parts["site"]))[:2]
        text += f' site1="{one}" site2="{other}"'
    else:
        one, *rest = draw(st.permutations(parts["body"]))[: draw(st.integers(1, 2))]
        text += f' body1="{one}"' + "".join(f' body2="{each}"' for each in rest)
        if tag == "connect" or draw(st.booleans()):
            text += f' anchor="{draw(vector(3))}"'
        if tag == "weld" and draw(st.booleans()):
            text += f' relpose="{draw(vector(3))} {draw(st.sampled_from(["0 0 0 0", "1 0.2 -0.3 2"]))}"'
    if tag == "weld" and draw(st.booleans()):
        text += f' torquescale="{draw(lengths)}"'
    return f"{text}/>"


@st.composite
def constrained(draw: Draw) -> str:
    """A random robot with tendons, equality constraints, compensated bodies and motors on tendons."""
    # Of the copies of a joint j1, MuJoCo takes another joint j10 for one.
    text = re.sub("<replicate.*</replicate>", "", draw(models()))
    text = re.sub(
        r"<body name", lambda _: f'<body gravcomp="{draw(st.sampled_from([0, 1, 0.4]))}" name', text
    )
    compiled = mujoco.MjModel.from_xml_string(text)
    joints = [
        compiled.joint(k).name
        for k in range(compiled.njnt)
        if compiled.jnt_type[k] >= 2 and k < compiled.njnt
    ]
    parts = {
        "joint": joints,
        "body": [compiled.body(k).name for k in range(1, compiled.nbody)],
        "site": [compiled.site(k).name for k in range(compiled.nsite)],
        "tendon": ["t0", "t1"],
    }
    if not joints:
        return text
    cables = "".join(draw(tendons(joints, f"t{k}")) for k in range(2))
    couplings = "".join(draw(equalities(parts, f"e{k}")) for k in range(draw(st.integers(1, 4))))
    motors = f'<position name="m" tendon="t0" kp="3" gear="{draw(lengths)}" forcerange="-2 2"/>'
    defaults = (
        '<default class="stiff"><equality solref="0.3 2"/><tendon stiffness="2" damping="1"/></default>'
    )
    return text.replace('<default class="dense">', f'{defaults}<default class="dense">').replace(
        "</mujoco>",
        f"<tendon>{cables}</tendon><equality>{couplings}</equality><actuator>{motors}</actuator></mujoco>",
    )


def engine_q(model: Model, q: Floats) -> Floats:
    """Return the qpos of MuJoCo, whose quaternions are w, x, y, z."""
    qpos = np.array(q)
    for k in model.quaternions:
        qpos[k : k + 4] = q[[k + 3, k, k + 1, k + 2]]
    return qpos


class Computed:
    """MuJoCo's results at a random state near `qpos0`, and dynx's coordinates of it."""

    def __init__(self, text: str, model: Model, seed: int) -> None:
        self.engine = engine = mujoco.MjModel.from_xml_string(text)
        engine.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
        random, data = np.random.default_rng(seed), mujoco.MjData(engine)
        self.model = model
        self.q = model.integrate(model.initial_configuration, random.uniform(-0.5, 0.5, model.nv))
        self.v = random.normal(size=model.nv)
        data.qpos[:], data.qvel[:] = engine_q(model, self.q), self.v
        data.eq_active[:] = True
        mujoco.mj_forward(engine, data)
        self.data = data
        self.frames = dynx.backend("reference", model).forward_kinematics(self.q)

    def pose(self, frame: str) -> Floats:
        if frame == "world" and "world" not in self.model.frame_names:
            return np.eye(4)
        return np.asarray(self.frames[self.model.frame_index(frame)])

    def residual(self, name: str) -> Floats:
        """Return the entries of the constraint of that name that MuJoCo computes."""
        kind, number = mujoco.mjtConstraint.mjCNSTR_EQUALITY, self.engine.equality(name).id
        rows = [
            k
            for k in range(self.data.nefc)
            if self.data.efc_type[k] == kind and self.data.efc_id[k] == number
        ]
        return np.array(self.data.efc_pos[rows])

    def close(self, got: object, want: object, scale: float = 1.0) -> bool:
        """Check whether two results differ by rounding alone, relative to the size of the robot."""
        size = max(1.0, float(np.abs(self.frames).max()), float(np.abs(np.array(want)).max(initial=0.0)))
        return bool(np.abs(np.array(got) - np.array(want)).max(initial=0.0) <= ROUNDING * size * scale)


def stated_residual(state: Computed, equality: StatedEquality) -> Floats:
    """Return the residual of MuJoCo from the constraint as the model states it."""
    model, q = state.model, state.q

    def value(name: str) -> float:
        if equality.object_type == "joint":
            return float(q[model.position_index(name)])
        (tendon,) = (each for each in model.tendons or () if each.name == name)
        return sum(factor * float(q[model.position_index(joint)]) for joint, factor in tendon.terms)

    if equality.type in ("joint", "tendon"):
        y = value(equality.first) - equality.references[0]
        x = value(equality.second) - equality.references[1] if equality.second else 0.0
        return np.array([y - sum(c * x**k for k, c in enumerate(equality.polynomial))])
    ends = zip(equality.objects, (equality.first_pose, equality.second_pose), strict=True)
    first, second = (state.pose(name) @ pose.matrix for name, pose in ends)
    offset = first[:3, 3] - second[:3, 3]
    if equality.type == "connect":
        return offset
    x, y, z, _ = quat_from_rotation(second[:3, :3].T @ first[:3, :3])
    return np.concatenate([offset, equality.torque_scale * np.array([x, y, z])])


def passive_torque(state: Computed, tendon: StatedTendon) -> Floats:
    """Return the torque (nv,) of a tendon's spring and damper."""
    gradient = np.zeros(state.model.nv)
    length = 0.0
    for joint, factor in tendon.terms:
        gradient[state.model.coordinate_index(joint)] = factor
        length += factor * state.q[state.model.position_index(joint)]
    stretch = np.clip(length, *tendon.spring_length) - length
    return np.asarray(gradient * (tendon.stiffness * stretch - tendon.damping * float(gradient @ state.v)))


def compensating_torque(state: Computed) -> Floats:
    """Return the torque (nv,) that holds the compensated weights, in MuJoCo's coordinates."""
    model, q = state.model, state.q
    reference = dynx.backend("reference", model)
    tau = np.zeros(model.nv)
    for each in model.gravity_compensation or ():
        inertial = model.inertial(each.link)
        J = reference.jacobian(q, each.link, point=inertial.origin.xyz)[:3]
        tau -= each.factor * inertial.mass * np.array(model.gravity) @ J
    if model.floating:
        R = state.pose(model.root)[:3, :3]
        tau[:3] = R @ tau[:3]
    return tau


def check(text: str, model: Model, seed: int) -> None:
    """Compare MuJoCo's constraints, tendons and compensation with those that the model states."""
    state = Computed(text, model, seed)
    engine, data = state.engine, state.data
    for k, tendon in enumerate(model.tendons or ()):
        length = sum(factor * state.q[model.position_index(joint)] for joint, factor in tendon.terms)
        assert state.close(data.ten_length[k], length)
        assert (engine.tendon_frictionloss[k], engine.tendon_armature[k]) == (
            tendon.friction,
            tendon.armature,
        )
        for limited, ends, bounds in (
            (engine.tendon_limited, engine.tendon_range, tendon.range),
            (engine.tendon_actfrclimited, engine.tendon_actfrcrange, tendon.force_range),
        ):
            assert bool(limited[k]) == bool(np.isfinite(bounds).any())
            assert not limited[k] or np.array_equal(ends[k], bounds)
    assert state.close(data.qfrc_gravcomp, compensating_torque(state), 1e2)
    springs = mujoco.MjModel.from_xml_string(text)
    springs.tendon_stiffness[:] = springs.tendon_damping[:] = 0.0
    without = mujoco.MjData(springs)
    without.qpos[:], without.qvel[:] = data.qpos, data.qvel
    mujoco.mj_forward(springs, without)
    torque = sum((passive_torque(state, each) for each in model.tendons or ()), np.zeros(model.nv))
    assert state.close(data.qfrc_passive - without.qfrc_passive, torque, 1e2)
    assert engine.neq == len(model.equalities or ())
    for each in model.equalities or ():
        got, want = state.residual(each.name), stated_residual(state, each)
        # MuJoCo drops constraints that no joint can change.
        if each.type == "weld":
            got, want = np.abs(got), np.abs(want)  # a quaternion has two signs
        assert not len(got) or state.close(got, want)
        row = engine.equality(each.name)
        assert bool(engine.eq_active0[row.id]) == each.active
        for stated, compiled in ((each.solref, engine.eq_solref), (each.solimp, engine.eq_solimp)):
            assert not stated or np.array_equal(compiled[row.id][: len(stated)], stated)
    moving = [each for each in model.actuators or () if each.tendon]
    assert [each.tendon for each in moving] == [
        engine.tendon(engine.actuator_trnid[k][0]).name
        for k in range(engine.nu)
        if engine.actuator_trntype[k] == mujoco.mjtTrn.mjTRN_TENDON
    ]
    start, other = engine_q(model, model.initial_configuration), np.array(engine.qpos0)
    for k in model.quaternions:
        other[k : k + 4] *= np.sign(other[k : k + 4] @ start[k : k + 4])
    assert state.close(start, other)


@given(constrained(), st.integers(0, 1000))
def test_constraints_tendons_and_compensation_are_those_of_mujoco(text: str, seed: int) -> None:
    model = dynx.load(text)
    check(text, model, seed)


@given(constrained(), st.integers(0, 1000))
def test_the_written_document_has_them_and_qpos0(text: str, seed: int) -> None:
    model = dynx.load(text)
    written = model.to_mjcf()
    back = dynx.load(written)
    assert [*robot_differences(model, back)] == []
    if "MuJoCo does not compile the document" in written:
        return
    check(written, back, seed)
    engine = mujoco.MjModel.from_xml_string(written)
    data = mujoco.MjData(engine)
    mujoco.mj_forward(engine, data)
    frames = dynx.backend("reference", model).forward_kinematics(model.initial_configuration)
    for k in range(1, engine.nbody):
        name = engine.body(k).name
        assert np.allclose(
            frames[model.frame_index(name)][:3, 3], data.xpos[k], rtol=0.0, atol=1e2 * ROUNDING
        )


ARM = """<mujoco>
  <compiler angle="radian"/>
  <worldbody><site name="wall"/>
    <body name="a" pos="0 0 1"><joint name="j" ref="0.4"/><geom name="g" size="0.1"/><site name="s"/>
      <body name="b" pos="0.3 0 0"><joint name="k" type="slide" axis="1 0 0"/><geom size="0.1"/>
        <body name="c"><joint name="ball" type="ball"/><geom size="0.1"/></body>
      </body>
    </body>
  </worldbody>
  SECTIONS
</mujoco>"""


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ('<tendon><fixed><joint joint="x" coef="1"/></fixed></tendon>', "has the joint 'x', which no body"),
        ('<tendon><fixed name="t"/></tendon>', "tendon 't' has no <joint>"),
        ('<tendon><fixed><joint joint="ball" coef="1"/></fixed></tendon>', "ball joint 'ball'"),
        ('<tendon><fixed><joint joint="j" coef="1"/><joint joint="j" coef="1"/></fixed></tendon>', "twice"),
        ('<tendon><fixed><joint joint="j"/></fixed></tendon>', "has no attribute coef"),
        ('<tendon><fixed springlength="2 1"><joint joint="j" coef="1"/></fixed></tendon>', "springlength"),
        ('<tendon><fixed stifness="1"><joint joint="j" coef="1"/></fixed></tendon>', "stiffness"),
        ("<tendon><fixd/></tendon>", "did you mean 'fixed'"),
        ('<equality><connect body1="a"/></equality>', "anchor"),
        ('<equality><connect body1="a" body2="x" anchor="0 0 0"/></equality>', "body 'x'"),
        ('<equality><weld body1="a" body2="a"/></equality>', "to itself"),
        ('<equality><weld body1="a" site2="s"/></equality>', "beside sites"),
        ('<equality><weld site1="s" site2="wall" anchor="0 0 0"/></equality>', "beside sites"),
        ('<equality><joint joint1="ball"/></equality>', "ball joint 'ball'"),
        ('<equality><joint joint2="j"/></equality>', "joint1"),
        ('<equality><joint joint1="j" polycoef="1 2 3 4 5 6"/></equality>', "polycoef"),
        ('<equality><joint name="x" joint1="j"/><joint name="x" joint1="k"/></equality>', "two constraints"),
        ('<equality><tendon tendon1="t"/></equality>', "tendon 't'"),
        ('<equality><joint joint1="j" active="yes"/></equality>', "active"),
    ],
)
def test_faults_are_errors_with_file_and_line_as_in_mujoco(section: str, message: str) -> None:
    text = ARM.replace("SECTIONS", section)
    with pytest.raises(ValueError, match=r"line 10|id"):
        mujoco.MjModel.from_xml_string(text)
    with pytest.raises(DescriptionError, match=re.escape(message)) as caught:
        dynx.load(text)
    assert caught.value.line == 10


def test_what_is_left_out_is_named() -> None:
    text = ARM.replace(
        "SECTIONS",
        '<tendon><spatial name="rope"><site site="s"/><site site="wall"/></spatial>'
        '<fixed name="t" margin="0.1" stiffness="1 2" springyield="3"><joint joint="j" coef="1"/></fixed>'
        "</tendon>"
        '<equality><tendon tendon1="rope"/></equality>'
        '<actuator><motor tendon="rope"/><motor name="m" tendon="t"/></actuator>',
    )
    model = dynx.load(text)
    notes = "\n".join(map(str, model.notes))
    for words in (
        "not read: 1 element of <tendon>",
        "<spatial> runs along sites",
        "not read of tendon 't': margin",
        "stiffness of tendon 't' is a polynomial",
        "springyield of tendon 't'",
        "<tendon> names the tendon 'rope', which the robot has not",
        "acts on the tendon 'rope'",
        "model.tendons has them as data",
    ):
        assert words in notes
    assert [each.tendon for each in model.actuators or ()] == ["t"]


def test_other_formats_name_what_they_leave_out() -> None:
    text = ARM.replace(' type="ball"', "").replace('name="b"', 'name="b" gravcomp="0.5"')
    text = text.replace(
        "SECTIONS",
        '<tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon>'
        '<equality><connect name="e" body1="a" anchor="0 0 1"/></equality>',
    )
    model = dynx.load(text)
    assert model.gravity_compensation == (StatedGravityCompensation("b", 0.5),)
    for to in ("urdf", "sdf"):
        notes = " ".join(convert(model, to).notes)
        for words in ("no tendons; those of the robot are left out ('t')", "'e'", "('b')"):
            assert words in notes
    assert dynx.load("planar_2r").tendons is None
    assert replace(model, tendons=None, equalities=None, gravity_compensation=None) == model
    assert dynx.load("ur5").initial_configuration.tolist() == [0.0] * 6


def test_a_locked_joint_takes_its_tendon_and_constraints_along(tmp_path: Path) -> None:
    sections = (
        '<tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon>'
        '<equality><joint name="e" joint1="j" joint2="k"/>'
        '<connect name="f" body1="b" anchor="0 0 1"/></equality>'
        '<actuator><motor name="m" tendon="t"/></actuator>'
    )
    model = dynx.load(ARM.replace("SECTIONS", sections), lock={"j": 0.7})
    conversion = convert(model, "mjcf")
    assert conversion.differences == ()
    notes = " ".join(conversion.notes)
    for words in (
        "Tendons of joints that do not move",
        "of a joint that the document lacks",
        "on tendons that",
    ):
        assert words in notes
    # The joint is locked elsewhere than in the pose of the file, where the points coincide.
    assert "pose of the document contradicts" in notes


def test_a_mimic_joint_of_dynx_counts_from_the_pose_of_the_file() -> None:
    text = ARM.replace(
        "SECTIONS",
        '<equality><joint name="dynx:mimic:k" joint1="k" joint2="j" polycoef="0.1 2 0 0 0"/></equality>',
    )
    mimic = dynx.load(text.replace(' type="ball"', "")).joint("k").mimic
    assert mimic is not None
    assert mimic.multiplier == 2.0
    assert mimic.offset == pytest.approx(0.1 - 2.0 * 0.4)


def test_attached_constraints_have_the_defaults_of_their_own_model(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text(
        '<mujoco model="part">'
        '<default><equality solref="0.5 1"/><tendon stiffness="7"/><position kp="9"/></default>'
        '<worldbody><body name="a"><joint name="j"/><geom size="0.1"/></body></worldbody>'
        '<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>'
        '<equality><joint name="e" joint1="j"/></equality>'
        '<actuator><position name="m" joint="j"/></actuator></mujoco>'
    )
    path = tmp_path / "whole.xml"
    path.write_text(
        '<mujoco><asset><model name="p" file="part.xml"/></asset><worldbody>'
        '<attach model="p" prefix="x_"/></worldbody></mujoco>'
    )
    model, engine = dynx.load(path), mujoco.MjModel.from_xml_path(str(path))
    assert model.tendons is not None
    assert model.equalities is not None
    assert model.actuators is not None
    assert [each.stiffness for each in model.tendons] == engine.tendon_stiffness.tolist() == [7.0]
    assert [each.solref for each in model.equalities] == [tuple(engine.eq_solref[0])] == [(0.5, 1.0)]
    assert [each.gain for each in model.actuators] == [engine.actuator_gainprm[0, 0]] == [9.0]
