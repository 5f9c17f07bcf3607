"""DX506 to DX516: limits, followers, angles, words and files."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.rules import Case, find_rule
from tests.rules.documents import LIMIT, case_of, joint, link

finite = st.floats(-10.0, 10.0)


def arm(*inside: str, limit: str = LIMIT, type: str = "revolute") -> Case:
    """Return two links and a joint, which is as given."""
    return case_of(link("base"), link("arm"), joint("elbow", "base", "arm", *inside, limit=limit, type=type))


def found(rule: str, case: Case) -> list[str | None]:
    """Return the joints that a rule names."""
    return [each.joint for each in find_rule(rule).detect(case)]


@pytest.mark.parametrize(("rule", "attribute"), [("DX506", "effort"), ("DX507", "velocity")])
@given(most=st.just(0.0) | st.floats(0.0, 1e6))
def test_a_limit_is_found_where_it_is_zero(rule: str, attribute: str, most: float) -> None:
    limits = {"effort": 1.0, "velocity": 1.0, attribute: most}
    limit = f'<limit lower="-1" upper="1" effort="{limits["effort"]}" velocity="{limits["velocity"]}"/>'
    assert found(rule, arm(limit=limit)) == ["elbow"] * (most == 0.0)


def test_a_sliding_joint_without_effort_has_no_force() -> None:
    limit = '<limit lower="-1" upper="1" effort="0" velocity="1"/>'
    for type, effort in (("revolute", "torque"), ("prismatic", "force")):
        (each,) = find_rule("DX506").detect(arm(limit=limit, type=type))
        assert each.message == f"the effort limit is 0, so no {effort} is allowed"


@pytest.mark.parametrize("rule", ["DX506", "DX507", "DX508", "DX510"])
def test_a_follower_needs_no_limits_of_its_own(rule: str) -> None:
    case = case_of(
        link("base"),
        link("arm"),
        link("hand"),
        joint("elbow", "base", "arm"),
        joint(
            "wrist",
            "arm",
            "hand",
            '<mimic joint="elbow"/>',
            limit='<limit lower="1" upper="1" effort="0" velocity="0"/>',
        ),
    )
    assert found(rule, case) == []


@given(lower=finite, upper=finite)
def test_a_range_of_no_width_and_one_without_zero(lower: float, upper: float) -> None:
    case = arm(limit=f'<limit lower="{lower!r}" upper="{upper!r}" effort="1" velocity="1"/>')
    assert found("DX508", case) == ["elbow"] * (lower == upper)
    assert found("DX510", case) == ["elbow"] * (min(lower, upper) > 0.0 or max(lower, upper) < 0.0)


@given(at=finite)
def test_equal_limits(at: float) -> None:
    case = arm(limit=f'<limit lower="{at!r}" upper="{at!r}" effort="1" velocity="1"/>')
    assert found("DX508", case) == ["elbow"]


def test_absent_limits_are_zero_and_said_to_be_absent() -> None:
    (each,) = find_rule("DX508").detect(arm(limit='<limit effort="1" velocity="1"/>'))
    assert "no lower and upper limit" in each.message


@pytest.mark.parametrize("written", ['lower="-1" upper="1"', 'upper="1"', ""])
def test_a_continuous_joint_loses_its_range_and_nothing_else(written: str) -> None:
    case = arm(limit=f'<limit effort="7" {written} velocity="3"/>', type="continuous")
    case = Case(case.source, choices={"DX509": "drop"})
    rule = find_rule("DX509")
    detections = rule.detect(case)
    assert len(detections) == bool(written)
    if not written:
        return
    remedy = rule.remedy(case, detections)
    assert remedy is not None
    assert '<limit effort="7" velocity="3"/>' in remedy.case.source.text
    assert remedy.case.model == case.model


multipliers = st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 0.1)


@given(st.lists(st.tuples(multipliers, finite), min_size=1, max_size=4), st.booleans())
def test_the_followers_of_a_chain_follow_its_head(chain: list[tuple[float, float]], written: bool) -> None:
    count = len(chain)
    links = [link(f"link{k}") for k in range(count + 2)]
    joints = [joint("joint0", "link0", "link1")]
    for k, (scale, offset) in enumerate(chain, start=1):
        numbers = f'multiplier="{scale!r}" offset="{offset!r}" ' if written else ""
        mimic = f'<mimic {numbers}joint="joint{k - 1}"/>'
        joints.append(joint(f"joint{k}", f"link{k}", f"link{k + 1}", mimic))
    case = Case(case_of(*links, *joints).source, choices={"DX511": "direct"})
    rule = find_rule("DX511")
    detections = rule.detect(case)
    assert [each.joint for each in detections] == [f"joint{k}" for k in range(2, count + 1)]
    if not detections:
        return
    remedy = rule.remedy(case, detections)
    assert remedy is not None
    assert remedy.case.model == case.model
    assert rule.detect(remedy.case) == []
    named = [each.first("mimic") for each in remedy.case.joints.values()]
    assert {each.attributes["joint"] for each in named if each is not None} == {"joint0"}


@given(scale=multipliers, offset=finite, margin=st.sampled_from([-0.02, 0.0, 0.02]))
def test_a_follower_leaves_its_limits(scale: float, offset: float, margin: float) -> None:
    low, high = sorted((scale * -1.0 + offset, scale * 1.0 + offset))
    width = margin * (high - low)
    limit = f'<limit lower="{low - width!r}" upper="{high + width!r}" effort="1" velocity="1"/>'
    follower = f'<mimic joint="elbow" multiplier="{scale!r}" offset="{offset!r}"/>'
    case = case_of(
        link("base"),
        link("arm"),
        link("hand"),
        joint("elbow", "base", "arm"),
        joint("wrist", "arm", "hand", follower, limit=limit),
    )
    assert found("DX512", case) == ["wrist"] * (margin < 0.0)


@given(st.floats(-100.0, 100.0) | st.sampled_from([6.28, -6.2832, 10.0, -7.5]))
def test_an_orientation_beyond_a_full_turn_is_in_degrees(angle: float) -> None:
    case = arm(f'<origin rpy="0 {angle!r} 0"/>')
    # A full turn rounded to two decimals or more is in radians.
    beyond = abs(angle) > 6.29
    assert found("DX513", case) == ["elbow"] * beyond
    assert any("radians" in note.message for note in case.model.notes) == beyond


def test_an_orientation_in_a_link_names_the_link() -> None:
    shape = '<visual><origin rpy="0 0 180"/><geometry><box size="1 1 1"/></geometry></visual>'
    (each,) = find_rule("DX513").detect(case_of(link("base", shape)))
    assert (each.link, each.joint) == ("base", None)
    assert repr(math.pi) in each.message


@pytest.mark.parametrize(
    ("lower", "upper", "type", "degrees"),
    [
        ("-90", "90", "revolute", True),
        ("0", "120", "revolute", True),
        ("-360", "360.0", "revolute", True),
        ("-25", "25", "revolute", False),
        ("-100", "100", "revolute", False),
        ("-1000", "1000", "revolute", False),
        ("-3.14", "45", "revolute", False),
        ("-90", "90", "prismatic", False),
        ("-90", "90", "continuous", False),
    ],
)
def test_limits_in_degrees(lower: str, upper: str, type: str, degrees: bool) -> None:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>'
    assert found("DX513", arm(limit=limit, type=type)) == ["elbow"] * degrees


@pytest.mark.parametrize("sign", ["", "-", "+"])
@pytest.mark.parametrize("decimals", [2, 3])
@pytest.mark.parametrize("count", range(1, 9))
@pytest.mark.parametrize("cut", [True, False])
def test_multiples_of_a_quarter_turn_cut_short(count: int, decimals: int, cut: bool, sign: str) -> None:
    meant = count * math.pi / 4.0
    scale = 10**decimals
    short = (math.floor(meant * scale) if cut else round(meant * scale)) / scale
    word = f"{sign}{short:.{decimals}f}"
    case = arm(f'<origin xyz="1 2 3" rpy="0 {word} 0.3"/>')
    assert found("DX514", case) == ["elbow"]
    rule = find_rule("DX514")
    chosen = Case(case.source, choices={"DX514": "full"})
    remedy = rule.remedy(chosen, rule.detect(chosen))
    assert remedy is not None
    whole = -meant if sign == "-" else meant
    assert remedy.case.model.joint("elbow").origin.rpy == (0.0, whole, 0.3)
    assert rule.remedy(case, rule.detect(case)) is None


@pytest.mark.parametrize(
    "word",
    ["1.5707", "1.5708", "1.570796", "3.1416", "1.5", "2", "1.6", "1.55", "0.79e0", "0.80", "7.85", "0.00"],
)
def test_other_angles_are_left_alone(word: str) -> None:
    assert found("DX514", arm(f'<origin rpy="{word} 0 0"/>')) == []


@pytest.mark.parametrize(
    ("element", "said"),
    [
        ('<dynamics dampng="1"/>', "dampng of <dynamics>"),
        ('<dynamic damping="1"/>', "<dynamic> in <joint>"),
        ('<mimmic joint="x"/>', "<mimmic> in <joint>"),
        ('<orgin xyz="0 0 1"/>', "<orgin> in <joint>"),
        ('<Origin xyz="0 0 1"/>', "<Origin> in <joint>"),
    ],
)
def test_a_misspelled_word(element: str, said: str) -> None:
    (each,) = find_rule("DX515").detect(arm(element))
    assert said in each.message
    assert each.joint == "elbow"


def test_misspelled_words_of_a_link_and_of_the_robot() -> None:
    case = case_of(
        '<link name="base"><intertial><mass value="1"/></intertial></link>', '<transmision name="t"/>'
    )
    messages = [each.message for each in find_rule("DX515").detect(case)]
    assert messages == [
        "<intertial> in <link> is ignored; <inertial> was meant",
        "<transmision> is ignored; <transmission> was meant",
    ]


@pytest.mark.parametrize(
    "element",
    [
        '<dynamics damping="1" spring_stiffness="2" spring_reference="0"/>',
        "<gazebo/>",
        '<drake:mimic joint="x"/>',
        '<safety_controller soft_lower_limit="0"/>',
        '<limits lower="0"/>',
    ],
)
def test_words_that_are_nobody_s_slip(element: str) -> None:
    # <limits> beside a <limit>: what it says is said already.
    assert found("DX515", arm(element)) == []


def test_a_mesh_that_is_missing_is_named_once(tmp_path: Path) -> None:
    (tmp_path / "here.stl").write_bytes(b"")
    robot = tmp_path / "robot.urdf"
    robot.write_text("<robot/>")
    shapes = [
        f'<{tag}><geometry><mesh filename="{name}.stl"/></geometry></{tag}>'
        for tag in ("visual", "collision")
        for name in ("here", "there")
    ]
    (each,) = find_rule("DX516").detect(case_of(link("base", *shapes), source=robot))
    assert each.link == "base"
    assert "'there.stl'" in each.message
    assert "did you mean 'here.stl'" in each.message
    assert find_rule("DX516").detect(case_of(link("base", *shapes))) == []


def test_a_missing_mesh_that_pybullet_finds_above_the_description_is_said_to_be_there(tmp_path: Path) -> None:
    (tmp_path / "urdf").mkdir()
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "above.stl").write_bytes(b"")
    robot = tmp_path / "urdf" / "robot.urdf"
    robot.write_text("<robot/>")
    shapes = [
        f'<visual><geometry><mesh filename="meshes/{name}.stl"/></geometry></visual>'
        for name in ("above", "nowhere")
    ]
    above, nowhere = find_rule("DX516").detect(case_of(link("base", *shapes), source=robot))
    assert above.message.endswith("PyBullet alone finds '../meshes/above.stl'")
    assert nowhere.message == "no file 'meshes/nowhere.stl'"
