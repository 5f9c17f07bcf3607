"""Effects of elements: variants that are evaluated together have the values of each alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dynx
from dynx.model.elements import Pose
from dynx.model.tree import Base
from dynx.same.effects import values, values_of_variants


@pytest.mark.parametrize(
    ("name", "base"), [("talos", "floating"), ("panda", "fixed"), ("romeo", "fixed"), ("scara", "floating")]
)
def test_variants_together_have_the_values_of_each(name: str, base: Base) -> None:
    model = dynx.load(name, base=base)
    rng = np.random.default_rng(0)
    variants = [model]
    for k in rng.integers(len(model.joints), size=3):
        x, y, z = rng.uniform(-0.5, 0.5, 3).tolist()
        joints = list(model.joints)
        joints[k] = replace(joints[k], origin=Pose((x, y, z), (z, x, y)))
        variants.append(replace(model, joints=tuple(joints)))
    links = list(model.links)
    heavy = next(k for k, link in enumerate(links) if link.inertial is not None)
    inertial = links[heavy].inertial
    assert inertial is not None
    links[heavy] = replace(links[heavy], inertial=replace(inertial, mass=2.0 * inertial.mass))
    variants.append(replace(model, links=tuple(links)))
    for together, variant in zip(values_of_variants(variants, model), variants, strict=True):
        alone = values(variant, model)
        for field in ("poses", "mass_matrix", "torque"):
            expected = getattr(alone, field)
            apart = np.max(np.abs(getattr(together, field) - expected))
            assert getattr(together, field).shape == expected.shape
            assert apart <= 1e-12 * np.max(np.abs(expected))
