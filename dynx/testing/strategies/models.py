"""Random robots: trees with every kind of joint, valid by construction."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any, Literal, get_args

from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError, UnknownNameError, nearest, shown
from dynx.model import Joint, JointDynamics, Limits, Link, Mimic, Model
from dynx.model.elements import INFINITY, JointType
from dynx.model.model import STANDARD_GRAVITY
from dynx.testing.strategies.geometry import (
    Strategy,
    numbers,
    origins,
    unit_vectors,
    vectors,
)
from dynx.testing.strategies.inertials import Kind, inertials

BaseChoice = Literal["fixed", "floating", "either"]
JOINT_TYPES: tuple[JointType, ...] = get_args(JointType)
ORIGINS, FRAME_PLACEMENTS, AXES = origins(), origins(0.5), unit_vectors()
MAX_LINKS = 64
"""A larger random robot shows no more, and makes one example as long as a hundred."""

# Names as files have them: plain, the world as root, links and joints alike, with slashes, not ASCII.
NAMINGS = (
    ("link{}", "joint{}"),
    ("world", "link{}", "joint{}"),
    ("part{}", "part{}"),
    ("arm/link {}", "arm/joint {}"),
    ("Glied_ä{}", "Gelenk_ö{}"),
)


def models(
    *,
    min_links: int = 1,
    max_links: int = 7,
    base: BaseChoice = "either",
    joint_types: Collection[str] = JOINT_TYPES,
    mimics: bool = True,
    locks: bool = True,
    physical: bool = True,
    solvable: bool = False,
    from_urdf: bool = False,
) -> Strategy[Model]:
    """A random robot of `min_links` to `max_links` links, valid by construction.

    Trees of any shape, joints in any order in the document, any axis and origin; solid and thin
    bodies, point masses, massless links; limits (of zero width, on one side, none), damping,
    friction and armature; further frames; gravity of any direction, or none.

    - `base`: ``"fixed"``, ``"floating"``, or ``"either"``
    - `joint_types`: the kinds of joint that may occur
    - `mimics`: whether some joints follow others, in chains too
    - `locks`: whether some joints are locked, so that they leave the coordinates
    - `physical`: False adds inertia tensors that no body can have
    - `solvable`: every body has mass and extent in all directions, so that the mass matrix is
      positive definite at every configuration and forward dynamics has an answer
    - `from_urdf`: only what a URDF file can say: standard gravity, no further frames, no locked
      joint

    Shrinks to `min_links` links in a chain, with a fixed base if that is allowed, the first of
    `joint_types` about z at the parent's origin, 1 kg cubes, and nothing that is optional.
    """
    _check_count("min_links", min_links, 1, MAX_LINKS)
    _check_count("max_links", max_links, 1, MAX_LINKS)
    if min_links > max_links:
        raise ArgumentError(f"min_links is {min_links}, more than max_links, which is {max_links}")
    if base not in get_args(BaseChoice):
        raise UnknownNameError(f"base is {shown(base)}{nearest(str(base), get_args(BaseChoice))}")
    if isinstance(joint_types, str) or not joint_types:
        raise ArgumentError(f"joint_types is {shown(joint_types)}; wanted one or more of {JOINT_TYPES}")
    for kind in joint_types:
        if kind not in JOINT_TYPES:
            raise UnknownNameError(f"no joint type {shown(kind)}{nearest(str(kind), JOINT_TYPES)}")
    flags = {
        "mimics": mimics,
        "locks": locks,
        "physical": physical,
        "solvable": solvable,
        "from_urdf": from_urdf,
    }
    for name, flag in flags.items():
        if not isinstance(flag, bool):
            raise DTypeError(f"{name} is {shown(flag)}; wanted True or False")
    if solvable and not physical:
        raise ArgumentError("solvable=True needs physical=True: other tensors may make M singular")
    kind_of_inertial: Kind = "solid" if solvable else "physical" if physical else "any"
    allowed = tuple(kind for kind in JOINT_TYPES if kind in joint_types)
    return _models(min_links, max_links, base, allowed, mimics, locks, inertials(kind_of_inertial), from_urdf)


@st.composite
def _models(
    draw: st.DrawFn,
    min_links: int,
    max_links: int,
    base: BaseChoice,
    joint_types: tuple[JointType, ...],
    mimics: bool,
    locks: bool,
    inertial: Strategy[Any],
    from_urdf: bool,
) -> Model:
    n = draw(st.integers(min_links, max_links))
    *root_name, link_name, joint_name = draw(st.sampled_from(NAMINGS))
    link_names = [link_name.format(k) for k in range(n)]
    link_names[0] = root_name[0] if root_name else link_names[0]
    links = [Link(name, draw(inertial)) for name in link_names]
    joints = [
        Joint(
            joint_name.format(k),
            draw(st.sampled_from(joint_types)),
            # How far back, so that a chain is what it shrinks to.
            link_names[k - 1 - draw(st.integers(0, k - 1))],
            link_names[k],
            origin=draw(ORIGINS),
            axis=draw(AXES),
        )
        for k in range(1, n)
    ]
    joints = [_equipped(draw, joint) for joint in joints]
    if mimics:
        joints = _with_mimics(draw, joints)
    lock: dict[str, float] = {}
    if locks and not from_urdf:
        movable = [joint.name for joint in joints if joint.moves]
        lock = {name: draw(numbers(1.0)) for name in movable if draw(_seldom())}
    if draw(st.booleans()):
        links, joints = draw(st.permutations(links)), draw(st.permutations(joints))
    model = Model.build(
        "random_robot",
        links,
        joints,
        base=draw(st.sampled_from(("fixed", "floating") if base == "either" else (base,))),
        gravity=STANDARD_GRAVITY if from_urdf else draw(st.just(STANDARD_GRAVITY) | vectors(10.0)),
        lock=lock,
        source="<random>",
    )
    if not from_urdf:
        for k in range(draw(st.integers(0, 2))):
            model = model.with_frame(f"frame{k}", draw(st.sampled_from(link_names)), draw(FRAME_PLACEMENTS))
    return model


def _seldom() -> Strategy[bool]:
    """True one time in six."""
    return st.integers(0, 5).map(lambda n: n == 5)


def _equipped(draw: st.DrawFn, joint: Joint) -> Joint:
    """The joint with limits and dynamics; a fixed joint has neither, and its axis means nothing."""
    if joint.type == "fixed":
        return replace(joint, axis=(1.0, 0.0, 0.0))
    reach = 1.0 if joint.type == "prismatic" else 3.0
    limits = Limits()
    if joint.type != "continuous" and draw(st.booleans()):
        ends = sorted((draw(numbers(reach)), draw(numbers(reach))))
        side = draw(st.integers(0, 3))
        lower = -INFINITY if side == 2 else ends[0]
        upper = INFINITY if side == 3 else ends[0] if side == 1 else ends[1]
        limits = Limits(lower, upper, velocity=2.0, effort=50.0)
    dynamics = JointDynamics()
    if draw(_seldom()):
        positive = numbers(1.0).map(abs)
        dynamics = JointDynamics(draw(positive), draw(positive), draw(positive))
    return replace(joint, limits=limits, dynamics=dynamics)


def _with_mimics(draw: st.DrawFn, joints: list[Joint]) -> list[Joint]:
    """Some joints follow others. A driver comes earlier in `joints` or is free: no cycle can form."""
    moving = [k for k, joint in enumerate(joints) if joint.moves]
    followers = [k for k in moving if draw(_seldom())]
    if len(followers) == len(moving):
        followers = followers[1:]
    followed = list(joints)
    for k in followers:
        drivers = [joints[other].name for other in moving if other < k or other not in followers]
        ratio = draw(st.sampled_from((1.0, -1.0, 0.5, 2.0, 0.0)) | numbers(3.0))
        followed[k] = replace(
            joints[k], mimic=Mimic(draw(st.sampled_from(drivers)), ratio, draw(numbers(1.0)))
        )
    return followed


def _check_count(name: str, value: int, least: int, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int):
        raise DTypeError(f"{name} is {shown(value)}; wanted a whole number")
    if not least <= value <= most:
        raise ArgumentError(f"{name} is {value}; wanted {least} to {most}")
