"""PyBullet's own models: each loads, or raises for a defect that it has."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from dynx.errors import DescriptionError, UnsupportedFeatureError
from dynx.model.loading import load

SPEC = importlib.util.find_spec("pybullet_data")
ROOT = Path(SPEC.origin).parent if SPEC is not None and SPEC.origin else None

# File, kind of error, line, and the defect, as an editor shows it.
DEFECTS = {
    "bicycle/bike.urdf": (DescriptionError, 103, "'0.07, 0, -0.69'"),
    "biped/biped2d_pybullet.urdf": (DescriptionError, 115, "'-1.57.'"),
    "humanoid/humanoid.urdf": (UnsupportedFeatureError, 40, "joint 'chest' is spherical"),
    "husky/husky.urdf": (DescriptionError, 97, "$(optenv HUSKY_IMU_XYZ"),
    "quadruped/microtaur/microtaur.urdf": (DescriptionError, 300, "'-3.14159 1.57079 0 0'"),
    "spherical_joint_limit.urdf": (UnsupportedFeatureError, 28, "joint 'neck' is spherical"),
    "torus_deform.urdf": (DescriptionError, None, "the robot has no link"),
}

pytestmark = pytest.mark.skipif(ROOT is None, reason="pybullet_data is not installed")


@pytest.mark.parametrize("file", DEFECTS)
def test_a_file_with_a_defect_is_refused_for_it(file: str) -> None:
    assert ROOT is not None
    kind, line, message = DEFECTS[file]
    with pytest.raises(kind) as caught:
        load(ROOT / file)
    assert message in str(caught.value)
    assert caught.value.line == line


def test_every_other_file_loads_and_is_read_back_equal() -> None:
    assert ROOT is not None
    files = sorted(path for path in ROOT.rglob("*.urdf"))
    assert len(files) > 1000
    for path in files:
        if path.relative_to(ROOT).as_posix() not in DEFECTS:
            model = load(path)
            assert load(model.to_urdf()) == model, path
