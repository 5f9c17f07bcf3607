"""Symmetric fingers: of equally good matchings, the one without reversed signs, in document order."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.model import Model
from dynx.model.elements import Inertial, Joint, JointType, Limits, Link, Mimic, Pose
from dynx.same import same_robot

HALF_TURN = 3.14159265358979


def gripper(
    prefix: str = "",
    *,
    yaw: float = 0.0,
    mass: float = 0.015,
    turns: bool = False,
    half_turn: float = HALF_TURN,
    mimic: bool = False,
    symmetric_palm: bool = False,
    uppers: tuple[float, float] = (0.04, 0.04),
) -> Model:
    """Return a hand on a joint, with two fingers; each is its own image under a half turn."""
    finger = Inertial(mass, Pose((0.0, 0.0, 0.01)), 2e-6, 0.0, 0.0, 3e-6, 0.0, 1e-6)
    off = 0.0 if symmetric_palm else 0.01
    palm = Inertial(0.7, Pose((off, 0.3 * off, 0.03)), 1e-3, 0.0, 0.0, 2e-3, 0.0, 1.5e-3)
    kind: JointType = "revolute" if turns else "prismatic"
    axis = (1.0, 0.0, 0.0) if turns else (0.0, 1.0, 0.0)

    def of_finger(number: int, rpy: tuple[float, float, float], follows: Mimic | None) -> Joint:
        name = f"{prefix}finger_{number}"
        place, limits = Pose((0.0, 0.0, 0.06), rpy), Limits(0.0, uppers[number - 1], 0.2, 20.0)
        return Joint(f"{name}_joint", kind, f"{prefix}hand", name, place, axis, limits, mimic=follows)

    leader = Mimic(f"{prefix}finger_1_joint", 1.0) if mimic else None
    joints = [
        Joint(
            f"{prefix}wrist",
            "continuous",
            f"{prefix}arm",
            f"{prefix}flange",
            Pose((0.1, 0.2, 0.3)),
            (0.0, 0.0, 1.0),
        ),
        Joint(
            f"{prefix}mount",
            "fixed",
            f"{prefix}flange",
            f"{prefix}hand",
            Pose((0.0, 0.0, 0.1), (0.0, 0.0, yaw)),
        ),
        of_finger(1, (0.0, 0.0, 0.0), None),
        of_finger(2, (0.0, 0.0, half_turn), leader),
    ]
    links = [
        Link(f"{prefix}arm"),
        Link(f"{prefix}flange"),
        Link(f"{prefix}hand", palm),
        Link(f"{prefix}finger_1", finger),
        Link(f"{prefix}finger_2", finger),
    ]
    return Model.build("gripper", links, joints)


@settings(deadline=None, max_examples=40)
@given(
    turns=st.booleans(),
    symmetric_palm=st.booleans(),
    yaw=st.sampled_from([0.0, 3.5e-8, -2e-7, 1e-3, 0.5]),
    other_yaw=st.sampled_from([0.0, 0.785398163]),
    half_turn=st.sampled_from([HALF_TURN, -3.1415927, 3.1416]),
    mass=st.sampled_from([0.015, 0.02]),
    mimics=st.tuples(st.booleans(), st.booleans()),
    tolerance=st.sampled_from([1e-9, 1e-7, 1e-5]),
)
def test_two_symmetric_fingers_are_matched_by_order_without_reversal(
    turns: bool,
    symmetric_palm: bool,
    yaw: float,
    other_yaw: float,
    half_turn: float,
    mass: float,
    mimics: tuple[bool, bool],
    tolerance: float,
) -> None:
    ours = gripper(turns=turns, symmetric_palm=symmetric_palm, yaw=other_yaw, mimic=mimics[0])
    theirs = gripper(
        "b_",
        turns=turns,
        symmetric_palm=symmetric_palm,
        yaw=other_yaw + yaw,
        half_turn=half_turn,
        mass=mass,
        mimic=mimics[1],
    )
    report = same_robot(ours, theirs, tolerance=tolerance)
    assert all(each.sign == 1 for each in report.coordinates)
    assert all(each.theirs == f"b_{each.ours}" for each in report.coordinates)
    assert not [each for each in report.attributes if "limit" in each.kind]


def test_of_equally_near_joints_those_with_the_same_limits_are_matched() -> None:
    ours = gripper(half_turn=0.0, uppers=(0.04, 0.02))
    report = same_robot(ours, gripper("b_", half_turn=0.0, uppers=(0.02, 0.04)))
    assert report.same
    assert [(each.ours, each.theirs) for each in report.coordinates[1:]] == [
        ("finger_1_joint", "b_finger_2_joint"),
        ("finger_2_joint", "b_finger_1_joint"),
    ]
    assert not [each for each in report.attributes if "limit" in each.kind]


def test_fingers_of_a_public_hand_are_matched_by_order() -> None:
    """The fingers of the panda, of which one follows the other in the first description alone."""
    text = dynx.load("panda").to_urdf().replace("panda_", "b_")
    start = text.index("<mimic")
    free = text[:start] + text[text.index("/>", start) + 2 :]
    report = same_robot("panda", free)
    assert [(each.part, each.theirs) for each in report.differences] == [("mimic", "b_finger_joint2")]
    assert [each.sign for each in report.coordinates] == [1] * 8
