"""Joints whose types differ, beside keyframes, tendons, couplings, motors and sensors: a verdict in both
orders, and no position that is compared with one of another type."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.same import same_robot

TYPES = {
    "ball": ('type="ball"', "0.8 0.6 0 0"),
    "hinge": ('type="hinge" axis="1 0 0"', "0.3"),
    "slide": ('type="slide" axis="1 0 0"', "0.3"),
    "fixed": (None, ""),
}
BODY = """<body name="b{n}" pos="0 0.1 0.3">{joint}
<inertial pos="0.1 0.05 -0.2" mass="1" diaginertia="0.02 0.03 0.025"/>"""


@dataclass(frozen=True)
class Robot:
    """A chain of bodies with joints of these types, and what couples its first two joints with numbers."""

    types: tuple[str, ...]
    floating: bool
    parts: frozenset[str]

    def text(self) -> str:
        bodies, coupled = "", []
        qpos = ["0 0 1 1 0 0 0"] if self.floating else []
        for n, kind in enumerate(self.types):
            attributes, position = TYPES[kind]
            joint = "" if attributes is None else f'<joint name="j{n}" {attributes}/>'
            bodies += BODY.format(n=n, joint=joint)
            qpos += [position] if position else []
            coupled += [f"j{n}"] if kind in ("hinge", "slide") else []
        bodies += "</body>" * len(self.types)
        if self.floating:
            bodies = BODY.format(n="root", joint="<freejoint/>") + bodies + "</body>"
        sections = [f'<keyframe><key name="home" qpos="{" ".join(qpos)}"/></keyframe>']
        if coupled:
            terms = "".join(f'<joint joint="{each}" coef="2"/>' for each in coupled)
            others = f'joint2="{coupled[1]}" polycoef="0 2 0 0 0"' if len(coupled) > 1 else ""
            sections += [
                f'<tendon><fixed name="t" stiffness="2">{terms}</fixed></tendon>',
                f'<equality><joint name="e" joint1="{coupled[0]}" {others}/></equality>',
                f'<actuator><motor name="m" joint="{coupled[0]}" gear="3"/></actuator>',
                f'<sensor><jointpos name="s" joint="{coupled[0]}"/></sensor>',
            ]
        written = "".join(each for each in sections if each[1 : each.index(">")] in self.parts)
        return f"<mujoco><worldbody>{bodies}</worldbody>{written}</mujoco>"


def chains(floating: bool, count: int) -> st.SearchStrategy[Robot]:
    parts = st.frozensets(st.sampled_from(("tendon", "equality", "actuator", "sensor")))
    return st.builds(
        Robot,
        st.tuples(*[st.sampled_from(sorted(TYPES))] * count),
        st.just(floating),
        parts.map(lambda some: some | {"keyframe"}),
    )


def pairs() -> st.SearchStrategy[tuple[Robot, Robot]]:
    return st.tuples(st.booleans(), st.integers(1, 3)).flatmap(
        lambda each: st.tuples(chains(*each), chains(*each))
    )


@settings(max_examples=40)
@given(pairs())
def test_robots_with_joints_of_other_types_have_a_verdict(pair: tuple[Robot, Robot]) -> None:
    first, second = pair
    report = same_robot(first.text(), second.text())
    assert report.same == (first.types == second.types)
    if report.unmatched:
        return
    keyframes = [each for each in report.attributes if each.kind == "configuration"]
    # The position of a joint of another type is named.
    assert bool(keyframes) == (first.types != second.types)
    named = [each.theirs for each in report.differences if each.part == "type"]
    assert {row.theirs for row in report.coordinates}.isdisjoint(named)
    # A model can be mended in all parts: its keyframes are those of the first robot.
    model = dynx.load(first.text())
    mended = same_robot(model, dynx.load(second.text())).mended
    if mended is not None and first.types != second.types:
        again = same_robot(model, mended)
        assert again.same
        assert [each for each in again.attributes if each.kind == "configuration"] == []


ONE = Robot(("ball",), False, frozenset(["keyframe"]))


@pytest.mark.parametrize(("kind", "position"), [("hinge", "0.3 rad"), ("slide", "0.3 m"), ("fixed", "fixed")])
def test_a_position_of_another_type_of_joint_is_named(kind: str, position: str) -> None:
    other = Robot((kind,), False, ONE.parts)
    for robots, texts in (((ONE, other), (0, 1)), ((other, ONE), (1, 0))):
        report = same_robot(*(each.text() for each in robots))
        (keyframe,) = (each for each in report.attributes if each.kind == "configuration")
        found = [(keyframe.first, keyframe.second)[k] for k in texts]
        assert found == ["j0 0.6 0 0 0.8", f"j0 {position}"]
        assert keyframe.effects == ()


def test_a_ball_joint_has_no_lower_limit() -> None:
    hinge = Robot(("hinge",), False, ONE.parts)
    free, limited = hinge.text(), hinge.text().replace('type="hinge"', 'type="hinge" range="-1 1"')
    for text, rows in ((free, []), (limited, [("lower limit", "none"), ("upper limit", "none")])):
        report = same_robot(ONE.text(), text)
        limits = [each for each in report.attributes if each.kind.endswith("limit")]
        assert [(each.kind, each.first) for each in limits] == rows


def test_a_joint_that_follows_one_without_a_counterpart_is_compared(tmp_path: Path) -> None:
    """The driver `lift` hangs on another link in each robot; `turn` follows it in both."""
    inertial = (
        '<inertial><mass value="1"/><origin xyz="0.1 0.2 0.3"/>'
        '<inertia ixx="1" iyy="1.2" izz="1.4" ixy="0.1" ixz="0.2" iyz="0.3"/></inertial>'
    )
    texts = []
    for parent in ("base", "tip"):
        links = "".join(f'<link name="{name}">{inertial}</link>' for name in ("base", "arm", "tip", "cage"))
        joints = "".join(
            f'<joint name="{name}" type="{kind}"><parent link="{above}"/><child link="{child}"/>'
            f'<origin xyz="0.3 0.1 0.2"/><axis xyz="{axis}"/>{more}'
            '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
            for name, kind, above, child, axis, more in (
                ("swing", "revolute", "base", "arm", "0 1 0", ""),
                ("turn", "revolute", "arm", "tip", "1 0 0", '<mimic joint="lift" multiplier="2"/>'),
                ("lift", "prismatic", parent, "cage", "0 0 1", ""),
            )
        )
        texts.append(tmp_path / f"{parent}.urdf")
        texts[-1].write_text(f'<robot name="r">{links}{joints}</robot>')
    report = same_robot(*texts)
    assert not report.same
    assert [each.theirs for each in report.unmatched] == ["lift"]
