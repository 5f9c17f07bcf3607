"""DX119: PyBullet's check for symmetric tensors, predicted to the last bit."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from dynx.doctor import diagnose
from dynx.engines.pybullet.file_checks import MAX_ASYMMETRY, tree_asymmetry
from dynx.engines.silence import silence
from dynx.model.elements import Inertial, Pose
from dynx.rules import Case, find_rule
from dynx.rules.inertia import CentralInertia, inertial_edits
from tests.rules.documents import case_of, joint, link
from tests.rules.trap_cases import assert_same_robot, mended

p = pytest.importorskip("pybullet")

RULE = find_rule("DX119")
MASSES = (80.0, 300.0, 1e4, 1e6)


def heavy(inertial: Inertial, type: str = "revolute") -> Case:
    """Make the case of a robot with a heavy arm, and a wheel on it."""
    case = case_of(
        link("base"),
        link("arm"),
        link("wheel"),
        joint("elbow", "base", "arm", type=type),
        joint("axle", "arm", "wheel"),
    )
    edits = inertial_edits(case.source, case.links["arm"], case.inertials["arm"], inertial)
    return case.with_source(case.source.apply(*edits))


def draws(count: int) -> Iterator[Inertial]:
    """Draw heavy bodies, half of them with products of inertia."""
    rng = random.Random(20)
    for k in range(count):
        m = rng.choice(MASSES) * rng.uniform(1.0, 2.0)
        xyz, rpy, products = (tuple(rng.uniform(-s, s) for _ in range(3)) for s in (0.5, 3.0, 0.02 * m))
        off = products if k % 2 else (0.0, 0.0, 0.0)
        pose = Pose((xyz[0], xyz[1], xyz[2]), (rpy[0], rpy[1], rpy[2]))
        yield Inertial(m, pose, 0.3 * m, off[0], off[1], 0.29 * m, off[2], 0.25 * m)


def inverse_dynamics_works(case: Case, folder: Path, fixed: bool = True) -> bool:
    """Check whether PyBullet computes a mass matrix."""
    path = folder / "robot.urdf"
    path.write_text(case.source.text)
    client = p.connect(p.DIRECT)
    try:
        with silence():
            p.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)
            flags = p.URDF_USE_INERTIA_FROM_FILE
            body = p.loadURDF(str(path), useFixedBase=fixed, flags=flags, physicsClientId=client)
            count = sum(
                p.getJointInfo(body, k, physicsClientId=client)[2] != p.JOINT_FIXED
                for k in range(p.getNumJoints(body, physicsClientId=client))
            )
            p.calculateMassMatrix(body, [0.0] * count, physicsClientId=client)
            return True
    except (SystemError, p.error):
        return False
    finally:
        p.disconnect(client)


def test_the_check_is_predicted_and_the_remedy_passes_it(tmp_path: Path) -> None:
    failed = 0
    for inertial in draws(60):
        case = heavy(inertial)
        works = inverse_dynamics_works(case, tmp_path)
        failed += not works
        assert (tree_asymmetry(inertial) <= MAX_ASYMMETRY) == works
        assert [each.link for each in RULE.detect(case)] == ["arm"] * (not works)
        if not works:
            _, remedy = mended("DX119", case)
            assert inverse_dynamics_works(remedy.case, tmp_path)
            assert_same_robot(case.model, remedy.case.model)
    assert failed > 10


def unsymmetric() -> Inertial:
    """Return the first body that fails, of some tonnes."""
    return next(each for each in draws(60) if tree_asymmetry(each) > 100 * MAX_ASYMMETRY)


def test_links_that_cannot_move_are_checked_and_the_root_is_not(tmp_path: Path) -> None:
    held = heavy(unsymmetric(), type="fixed")
    assert not inverse_dynamics_works(held, tmp_path)
    assert [each.link for each in RULE.detect(held)] == ["arm"]
    root = case_of(link("base"), link("arm"), joint("elbow", "base", "arm"))
    edits = inertial_edits(root.source, root.links["base"], root.inertials["base"], unsymmetric())
    root = root.with_source(root.source.apply(*edits))
    for fixed in (True, False):
        assert inverse_dynamics_works(root, tmp_path, fixed)
    assert not RULE.detect(root)


def test_each_of_two_places_is_proved_although_another_remedy_removes_it() -> None:
    """Principal axes (DX105) change the rounding, so that neither place fails in the mended file."""
    fleeting = [
        each
        for each in draws(400)
        if tree_asymmetry(each) > MAX_ASYMMETRY
        and each.ixy
        and tree_asymmetry(CentralInertia.of(each).inertial(each.origin.rpy)) <= MAX_ASYMMETRY
    ]
    case = heavy(fleeting[0])
    edits = inertial_edits(case.source, case.links["wheel"], case.inertials["wheel"], fleeting[1])
    report = diagnose(case.source.apply(*edits).text, engines=["pybullet"])
    proved = {(each.rule, each.link) for each in report.differences if each.proved}
    assert {("DX119", "arm"), ("DX119", "wheel")} <= proved
    assert report.explained
