from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.engines.pybullet.canonical_urdf import Ballast, ballast_for, principal_inertia
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.mechanism import build_mechanism
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, longdouble
from dynx.spatial.so3 import skew
from dynx.testing.strategies import models

HALF_ULP = float(np.finfo(np.float64).eps) / 2

entries = st.floats(-1.0, 1.0, allow_subnormal=False)
symmetric = st.tuples(*[entries] * 6)


def _matrix(six: tuple[float, ...]) -> Array:
    xx, xy, xz, yy, yz, zz = six
    return longdouble([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _size(A: Array) -> float:
    return float(np.max(np.abs(A)))


@given(st.floats(1e-6, 1e6), st.tuples(entries, entries, entries), symmetric)
def test_principal_inertia_rebuilds_the_body(
    mass: float, center: tuple[float, ...], six: tuple[float, ...]
) -> None:
    c, arm = longdouble(center), skew(longdouble(center))
    about_origin = _matrix(six) - longdouble(mass) * (arm @ arm)
    body = principal_inertia(RigidInertia(longdouble(mass), c * longdouble(mass), about_origin))
    arm = skew(body.center)
    rebuilt = body.axes @ np.diag(longdouble(body.moments)) @ body.axes.T - longdouble(body.mass) * (
        arm @ arm
    )
    # The moments are rounded to float64 once; a negative one of that size stands for zero.
    assert _size(rebuilt - about_origin) <= 12 * 2 * HALF_ULP * max(_size(about_origin), _size(_matrix(six)))
    assert np.linalg.det(body.axes.astype(float)) > 0


def test_a_point_mass_has_no_negative_moment() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        c = longdouble(rng.standard_normal(3))
        arm = skew(c)
        point = RigidInertia(longdouble(0.3), c * longdouble(0.3), -longdouble(0.3) * (arm @ arm))
        assert np.min(principal_inertia(point).moments) >= 0.0


def _model(root: Inertial | None, tip: Inertial | None, base: str = "floating") -> Model:
    model = Model.build(
        "two", [Link("root", root), Link("tip", tip)], [Joint("j", "revolute", "root", "tip")]
    )
    return model.with_base("floating" if base == "floating" else "fixed")


def _ballast(model: Model) -> tuple[Ballast, ...]:
    return ballast_for(build_mechanism(model, longdouble))


SOUND = Inertial(1.0, Pose((0.1, 0.2, 0.3)), ixx=0.1, iyy=0.1, izz=0.1)


@pytest.mark.parametrize(
    "tip",
    [
        SOUND,
        None,
        Inertial(1.0, Pose((0.1, 0.2, 0.3))),
        Inertial(0.0, Pose((0.1, 0.2, 0.3)), ixx=1.0, iyy=1.0, izz=1.0),
        Inertial(1.0, ixx=1.0, iyy=0.1, izz=0.1),
    ],
    ids=["sound", "no inertial", "point mass", "rotor without mass", "broken triangle inequality"],
)
def test_what_bullet_can_hold_needs_no_ballast(tip: Inertial | None) -> None:
    assert _ballast(_model(SOUND, tip)) == (Ballast(), Ballast())


def test_a_root_without_mass_needs_ballast_only_where_it_floats() -> None:
    assert _ballast(_model(None, SOUND))[0].mass > 0.0
    assert _ballast(_model(None, SOUND, base="fixed")) == (Ballast(), Ballast())


def test_a_negative_moment_needs_ballast() -> None:
    load = _ballast(_model(SOUND, Inertial(1.0, ixx=-0.1, iyy=0.2, izz=0.3)))[1]
    assert load.mass == 0.0
    assert load.rotational > 0.1


@given(models(physical=False))
def test_with_ballast_once_or_twice_bullet_takes_every_body(model: Model) -> None:
    mechanism = build_mechanism(model, longdouble)
    root, *rest = ballast_for(mechanism)
    bodies = [(load, body.inertia, False) for load, body in zip(rest, mechanism.bodies, strict=True)]
    if model.floating:
        bodies.append((root, mechanism.root, True))
        assert float(root.add_to(mechanism.root, 1).mass) > 0.0
    for load, inertia, about_center in bodies:
        for times in (1, 2):
            loaded = principal_inertia(load.add_to(inertia, times), about_center=about_center)
            assert loaded.mass >= 0.0
            assert loaded.accepted
