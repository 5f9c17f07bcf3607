"""Fixed-joint merging preserves masses, inertias and frames, in any scalar type."""

from __future__ import annotations

import mpmath
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from dynx.model import Mechanism, Model, build_mechanism
from dynx.model.mechanism import ROOT, joint_motion
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import rotate
from dynx.testing.strategies import configurations, models
from tests.model.placement import frame_poses, total_inertia
from tests.spatial.rounding import assert_same_to_rounding

Floats = NDArray[np.float64]


def body_poses(mechanism: Mechanism, q_joints: Floats, base: Floats) -> dict[int, tuple[Array, Array]]:
    """Return (R, p) of every body in the world, and of the root."""
    poses = {ROOT: (base[:3, :3], base[:3, 3])}
    for k, (body, value) in enumerate(zip(mechanism.bodies, q_joints, strict=True)):
        R_parent, p_parent = poses[body.parent]
        R, p = joint_motion(body, np.asarray(value))
        poses[k] = (R_parent @ R, p_parent + rotate(R_parent, p))
    return poses


@given(st.data())
def test_frames_and_total_inertia_are_those_of_the_links(data: st.DataObject) -> None:
    model = data.draw(models(physical=False))
    q = data.draw(configurations(model))
    mechanism, base = model.mechanism, 7 if model.floating else 0
    tree = q if mechanism.coupling is None else mechanism.coupling.expand_q(q)
    # The root body of a fixed base is the world, also where the base has a pose of its own.
    T_world_base = frame_poses(model, q)[0] if model.floating else np.eye(4)
    poses = body_poses(mechanism, tree[base:], T_world_base)
    size = 4.0 * (1.0 + float(np.max(np.abs(tree), initial=0.0)))

    for frame, T in zip(mechanism.frames, frame_poses(model, q), strict=True):
        R, p = poses[frame.body]
        assert_same_to_rounding(R @ frame.R, T[:3, :3], 64 * len(model.links), size=size)
        assert_same_to_rounding(
            p + R @ frame.p, T[:3, 3], 64 * len(model.links), size=size * len(model.links)
        )

    total = RigidInertia(np.zeros(()), np.zeros(3), np.zeros((3, 3)))
    for body, inertia in [(ROOT, mechanism.root), *enumerate(b.inertia for b in mechanism.bodies)]:
        total = total + inertia.transform(*poses[body])
    expected = total_inertia(model, q)
    weight, reach = max(1.0, model.total_mass), size * len(model.links)
    assert_same_to_rounding(total.mass, model.total_mass, 4 * len(model.links), size=weight)
    for field in ("mass", "first_moment", "rotational_inertia"):
        got, wanted = getattr(total, field), getattr(expected, field)
        assert_same_to_rounding(got, wanted, 128 * len(model.links), size=weight * reach**2)


@given(models())
def test_tree_coordinates_are_the_moving_joints_in_order(model: Model) -> None:
    mechanism = model.mechanism
    assert [body.joint for body in mechanism.bodies] == [j.name for j in model.joints if j.moves]
    assert all(body.parent < k for k, body in enumerate(mechanism.bodies))
    assert tuple(frame.name for frame in mechanism.frames) == model.frame_names
    extra = 6 if model.floating else 0
    assert mechanism.nv == len(mechanism.bodies) + extra
    assert mechanism.nq == mechanism.nv + (1 if model.floating else 0)


@given(st.data())
def test_coupling_matches_the_mimic_joints(data: st.DataObject) -> None:
    model = data.draw(models())
    q = data.draw(configurations(model))
    coupling, base = model.mechanism.coupling, 7 if model.floating else 0
    moving = [joint for joint in model.joints if joint.moves]
    if coupling is None:
        assert all(joint.mimic is None for joint in moving)
        return
    value = dict(zip(model.joint_names, q[base:].tolist(), strict=True))
    expected = [
        value[j.name] if j.mimic is None else j.mimic.multiplier * value[j.mimic.joint] + j.mimic.offset
        for j in moving
    ]
    np.testing.assert_array_equal(coupling.expand_q(q), np.concatenate([q[:base], expected]))
    S = coupling.matrix()
    assert S.shape == (model.mechanism.nv, model.nv)
    at_rest = coupling.expand_q(model.neutral())[base:]
    slopes = coupling.expand_q(model.neutral() + np.eye(model.nq)[base:])[:, base:] - at_rest
    size = 1.0 + float(np.max(np.abs(at_rest), initial=0.0)) + float(np.max(np.abs(S), initial=0.0))
    assert_same_to_rounding(S[base and 6 :, base and 6 :], slopes.T, 4, size=size)


def fifty_digits(numbers: object) -> Array:
    return np.asarray(np.frompyfunc(mpmath.mpf, 1, 1)(np.asarray(numbers)), dtype=object)


@settings(max_examples=50)
@given(models(max_links=5))
def test_merging_in_fifty_digits(model: Model) -> None:
    with mpmath.workdps(50):
        exact = build_mechanism(model, fifty_digits)
    rounded = model.mechanism
    weight, reach = max(1.0, model.total_mass), 4.0 * len(model.links)
    pairs: list[tuple[object, object, float]] = [(exact.root, rounded.root, weight * reach**2)]
    for ours, theirs in zip(exact.bodies, rounded.bodies, strict=True):
        pairs.append((ours.inertia, theirs.inertia, weight * reach**2))
        assert_same_to_rounding(np.array(ours.R, dtype=float), theirs.R, 64 * len(model.links))
        assert_same_to_rounding(np.array(ours.p, dtype=float), theirs.p, 64 * len(model.links), size=reach)
    for ours_inertia, theirs_inertia, size in pairs:
        for field in ("mass", "first_moment", "rotational_inertia"):
            got = np.array(getattr(ours_inertia, field), dtype=float)
            wanted = getattr(theirs_inertia, field)
            assert_same_to_rounding(got, wanted, 128 * len(model.links), size=size)
