"""Random robots: trees with every kind of joint, valid by construction."""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, TypeVar, get_args

import numpy as np
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DTypeError, UnknownNameError, nearest, shown
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model, Pose
from dynx.model.elements import INFINITY, JointType, Vector
from dynx.model.tree import STANDARD_GRAVITY, Base
from dynx.spatial.so3 import rotation_from_rpy
from dynx.testing.strategies.geometry import Strategy, angles, numbers, origins, unit_vectors, vectors

# Inertials of bodies that can exist, of bodies that cannot, and absent ones.


Kind = Literal["solid", "physical", "any"]
KINDS: tuple[Kind, ...] = ("solid", "physical", "any")


def inertials(kind: Kind = "physical") -> Strategy[Inertial | None]:
    """Draw the ``<inertial>`` of a link, or None. Shrinks to None if the kind allows None, otherwise to a
    cube of 1 kg at the link's origin.

    - ``"solid"``: positive mass and extent along every axis, so that any motion has inertia
    - ``"physical"``: also plates, rods, point masses, an explicit zero, and no inertial at all
    - ``"any"``: also tensors that no body can have, with negative principal moments or a broken
      triangle inequality

    A body is drawn as its mass and its radii of gyration along three rotated axes, so that the tensor is
    physical by construction, up to rounding.
    """
    if kind not in KINDS:
        raise UnknownNameError(f"kind is {shown(kind)}{nearest(kind, KINDS)}")
    return _inertials(kind)


@lru_cache(maxsize=len(KINDS))
def _inertials(kind: Kind) -> Strategy[Inertial | None]:
    solid = _bodies(st.sampled_from((0.25, 0.125, 0.5)) | st.floats(0.05, 0.5).map(_rounded))
    if kind == "solid":
        return solid
    thin = _bodies(st.sampled_from((0.0, 0.25)))
    choices: list[Strategy[Inertial | None]] = [st.none(), solid, thin, st.just(Inertial())]
    if kind == "any":
        choices.append(_impossible())
    return st.one_of(choices)


def _masses() -> Strategy[float]:
    return st.sampled_from((1.0, 2.0, 0.5)) | st.floats(-1.0, 1.0).map(lambda x: _rounded(10.0**x))


def _bodies(radius: Strategy[float]) -> Strategy[Inertial | None]:
    turn = st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(angles(), angles(), angles()))
    return st.builds(_body, _masses(), st.tuples(radius, radius, radius), turn, origins(0.5))


def _body(mass: float, radii: Vector, turn: Vector, origin: Pose) -> Inertial:
    """Make a body with radii of gyration along axes that are rotated by `turn` (rpy) in `origin`."""
    squares = np.array(radii) ** 2
    principal = mass * (np.sum(squares) - squares)
    R = rotation_from_rpy(np.array(turn))
    tensor = R @ np.diag(principal) @ R.T if any(turn) else np.diag(principal)
    tensor = 0.5 * (tensor + tensor.T)
    return Inertial(mass, origin, *tensor[np.triu_indices(3)].tolist())


def _impossible() -> Strategy[Inertial | None]:
    def inertial(mass: float, origin: Pose, moments: Vector, products: Vector) -> Inertial:
        (xx, yy, zz), (xy, xz, yz) = moments, products
        return Inertial(mass, origin, xx, xy, xz, yy, yz, zz)

    moments = st.tuples(numbers(0.5), numbers(0.5), numbers(0.5))
    return st.builds(inertial, _masses(), origins(0.5), moments, vectors(0.25))


def _rounded(x: float) -> float:
    """Round to six significant digits."""
    return 0.0 if x == 0.0 else round(x, 5 - math.floor(math.log10(abs(x))))


T = TypeVar("T")
BaseChoice = Literal["fixed", "floating", "either"]
JOINT_TYPES: tuple[JointType, ...] = get_args(JointType)
COMMON_JOINT_TYPES: tuple[JointType, ...] = tuple(kind for kind in JOINT_TYPES if kind != "ball")
"""Types of joints with one coordinate at most, which all backends take."""
MAX_LINKS = 64
"""Largest number of links. Larger robots find no further defects and take much longer."""

# Patterns of names in real files: plain, with the world as root, equal for links and joints, with slashes,
# not ASCII.
NAMINGS = (
    ("link{}", "joint{}"),
    ("world", "link{}", "joint{}"),
    ("part{}", "part{}"),
    ("arm/link {}", "arm/joint {}"),
    ("Glied_ä{}", "Gelenk_ö{}"),
)


def optional(strategy: Strategy[T]) -> Strategy[T | None]:
    """Draw from the strategy one time in six, otherwise None."""
    return st.integers(0, 5).flatmap(lambda n: strategy if n == 5 else st.none())


def _limits(reach: float) -> Strategy[Limits]:
    """Draw the limits that are absent, of some width, of zero width, or one-sided."""
    ends = st.tuples(numbers(reach), numbers(reach)).map(sorted)
    finite = ends.map(lambda ends: Limits(ends[0], ends[1], velocity=2.0, effort=50.0))
    return st.one_of(
        st.just(Limits()),
        finite,
        finite.map(lambda limits: replace(limits, upper=limits.lower)),
        finite.map(lambda limits: replace(limits, upper=INFINITY)),
        finite.map(lambda limits: replace(limits, lower=-INFINITY)),
    )


# These are made once, because making a strategy takes longer than drawing from it.
ORIGINS, AXES, BACK = origins(), unit_vectors(), st.integers(0, MAX_LINKS)
FRAMES = st.lists(st.tuples(st.integers(0, MAX_LINKS), origins(0.5)), max_size=2)
GRAVITIES = st.just(STANDARD_GRAVITY) | vectors(10.0)
RATIOS = st.sampled_from((1.0, -1.0, 0.5, 2.0, 0.0)) | numbers(3.0)
LIMITS: dict[JointType, Strategy[Limits]] = {
    "revolute": _limits(3.0),
    # This is drawn for every joint even if it is not used, so that all joints make the same number of choices
    # and shrink to the first type.
    "continuous": _limits(3.0).map(lambda dropped: Limits()),
    "prismatic": _limits(1.0),
    "ball": st.just(Limits()) | numbers(3.5).map(lambda angle: Limits(0.0, abs(angle), 2.0, 50.0)),
}
DYNAMICS = optional(st.builds(JointDynamics, *[numbers(1.0).map(abs)] * 4, numbers(1.0))).map(
    lambda dynamics: dynamics or JointDynamics()
)


def models(
    *,
    min_links: int = 1,
    max_links: int = 7,
    base: BaseChoice = "either",
    joint_types: Collection[str] = COMMON_JOINT_TYPES,
    mimics: bool = True,
    locks: bool = True,
    physical: bool = True,
    solvable: bool = False,
    from_urdf: bool = False,
) -> Strategy[Model]:
    """Draw a random robot of `min_links` to `max_links` links, valid by construction.

    Trees of any shape, joints in any order in the document, any axis and origin; solid and thin
    bodies, point masses, massless links; limits (of zero width, on one side, none), damping,
    friction and armature; further frames; gravity of any direction, or none; a fixed base at any pose.

    - `base`: ``"fixed"``, ``"floating"``, or ``"either"``
    - `joint_types`: the kinds of joint that may occur; by default all but ``"ball"``, which some backends
      refuse
    - `mimics`: whether some joints follow others, in chains too, of a robot without ball joints
    - `locks`: whether some joints other than ball joints are locked, so that they leave the coordinates
    - `physical`: False adds inertia tensors that no body can have
    - `solvable`: every body has mass and extent in all directions, so that the mass matrix is
      positive definite at every configuration and forward dynamics has a solution
    - `from_urdf`: only what a URDF file can express: standard gravity, no further frames, no locked
      joint, a fixed base at the world frame

    Shrinks to `min_links` links in a chain, with a fixed base if that is allowed, joints that are
    fixed or else the first of `joint_types` about z, at the parent's origin, and nothing that is
    optional: massless links where they may occur, else 1 kg cubes.
    """
    _check_count("min_links", min_links, 1, MAX_LINKS)
    _check_count("max_links", max_links, 1, MAX_LINKS)
    if min_links > max_links:
        raise ArgumentError(f"min_links is {min_links}, more than max_links, which is {max_links}")
    if base not in get_args(BaseChoice):
        raise UnknownNameError(f"base is {shown(base)}{nearest(base, get_args(BaseChoice))}")
    if isinstance(joint_types, str) or not joint_types:
        raise ArgumentError(f"joint_types is {shown(joint_types)}; wanted one or more of {JOINT_TYPES}")
    for kind in joint_types:
        if kind not in JOINT_TYPES:
            raise UnknownNameError(f"no joint type {shown(kind)}{nearest(kind, JOINT_TYPES)}")
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
    allowed = tuple(kind for kind in JOINT_TYPES if kind in joint_types)
    bodies: Kind = "solid" if solvable else "physical" if physical else "any"
    return _cached_models(
        min_links, max_links, base, allowed, bodies, mimics, locks and not from_urdf, from_urdf
    )


@lru_cache(maxsize=64)
def _cached_models(
    min_links: int,
    max_links: int,
    base: BaseChoice,
    joint_types: tuple[JointType, ...],
    bodies: Kind,
    mimics: bool,
    locks: bool,
    from_urdf: bool,
) -> Strategy[Model]:
    """Make `models` of checked arguments."""
    inertial = inertials(bodies)
    limb = _limbs(joint_types, inertial, mimics, locks)
    bases: tuple[Base, ...] = ("fixed", "floating") if base == "either" else (base,)
    return _models(min_links, max_links, bases, limb, inertial, from_urdf)


@dataclass(frozen=True)
class _Limb:
    """A link and its parent joint, before the robot is known; `back` counts links towards the root."""

    inertial: Inertial | None
    type: JointType
    back: int
    origin: Pose
    axis: Vector
    limits: Limits
    dynamics: JointDynamics
    mimic: tuple[int, float, float] | None
    lock: float | None


@st.composite
def _models(
    draw: st.DrawFn,
    min_links: int,
    max_links: int,
    bases: tuple[Base, ...],
    limb: Strategy[_Limb],
    inertial: Strategy[Inertial | None],
    from_urdf: bool,
) -> Model:
    # Everything that belongs to one link is drawn together, so that shrinking can remove a link at once.
    limbs = draw(st.lists(limb, min_size=min_links - 1, max_size=max_links - 1))
    *root_name, link_name, joint_name = draw(st.sampled_from(NAMINGS))
    names = [*root_name, *(link_name.format(k) for k in range(len(root_name), len(limbs) + 1))]
    links = [Link(names[0], draw(inertial))]
    links += [Link(name, limb.inertial) for name, limb in zip(names[1:], limbs, strict=True)]
    joints = [
        Joint(
            joint_name.format(k),
            limb.type,
            names[k - 1 - limb.back % k],
            names[k],
            limb.origin,
            limb.axis,
            limb.limits,
            limb.dynamics,
        )
        for k, limb in enumerate(limbs, start=1)
    ]
    lock = {
        joint.name: limb.lock
        for joint, limb in zip(joints, limbs, strict=True)
        if joint.moves and joint.type != "ball" and limb.lock is not None
    }
    if all(joint.type != "ball" for joint in joints):
        joints = _with_mimics(joints, [limb.mimic for limb in limbs])
    if draw(st.booleans()):
        links, joints = draw(st.permutations(links)), draw(st.permutations(joints))
    model = Model.build(
        "random_robot",
        links,
        joints,
        base=draw(st.sampled_from(bases)),
        gravity=STANDARD_GRAVITY if from_urdf else draw(GRAVITIES),
        lock=lock,
        source="<random>",
    )
    for k, (link, placement) in enumerate([] if from_urdf else draw(FRAMES)):
        model = model.with_frame(f"frame{k}", names[link % len(names)], placement)
    if not (from_urdf or model.floating):
        model = model.with_base_pose(draw(optional(ORIGINS)) or Pose())
    return model


def _limbs(
    joint_types: tuple[JointType, ...], inertial: Strategy[Inertial | None], mimics: bool, locks: bool
) -> Strategy[_Limb]:
    """Draw a link at the end of a chain; shrinks to a massless link, fixed at its parent's origin."""
    follow = st.tuples(st.integers(0, MAX_LINKS), RATIOS, numbers(1.0))

    @st.composite
    def limbs(draw: st.DrawFn) -> _Limb:
        kind = draw(st.sampled_from(joint_types))
        common = draw(inertial), kind, draw(BACK), draw(ORIGINS)
        if kind == "fixed":
            # A fixed joint has neither limits nor dynamics, and its axis has no meaning.
            return _Limb(*common, (1.0, 0.0, 0.0), Limits(), JointDynamics(), None, None)
        dynamics = draw(DYNAMICS)
        return _Limb(
            *common,
            draw(AXES),
            draw(LIMITS[kind]),
            replace(dynamics, stiffness=0.0) if kind == "ball" else dynamics,
            draw(optional(follow)) if mimics else None,
            draw(optional(numbers(1.0))) if locks else None,
        )

    return limbs()


def _with_mimics(joints: list[Joint], mimics: list[tuple[int, float, float] | None]) -> list[Joint]:
    """Make some joints mimic others. A driver is earlier in `joints` or independent: no cycle can form."""
    moving = [k for k, joint in enumerate(joints) if joint.moves]
    followers = [k for k in moving if mimics[k] is not None]
    if len(followers) == len(moving):
        followers = followers[1:]
    followed = list(joints)
    for k in followers:
        number, ratio, offset = mimics[k] or (0, 1.0, 0.0)
        drivers = [joints[other].name for other in moving if other < k or other not in followers]
        followed[k] = replace(joints[k], mimic=Mimic(drivers[number % len(drivers)], ratio, offset))
    return followed


def _check_count(name: str, value: int, least: int, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int):
        raise DTypeError(f"{name} is {shown(value)}; wanted a whole number")
    if not least <= value <= most:
        raise ArgumentError(f"{name} is {value}; wanted {least} to {most}")
