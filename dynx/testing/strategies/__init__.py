"""Hypothesis strategies for robots, configurations, poses, wrenches, URDF text and scenes.

    from hypothesis import given, strategies as st
    from dynx.testing.strategies import models, samples

    @given(st.data())
    def test_something(data):
        model = data.draw(models(max_links=5, solvable=True))
        q, v, a = data.draw(samples(model))

Drawn values are valid by construction, not by filtering, so no health check of Hypothesis fails and every
failing example shrinks. Shrink targets: a model shrinks to the fewest links in a chain with a fixed base,
standard gravity, fixed or revolute joints about z at the parent's origin, round numbers, no mimic joint, no
limits and no dynamics; a configuration to the neutral one; velocities and wrenches to zero; poses to the
identity; text to the plainest spelling; a scene to one ball at rest above a plane.

Arguments are checked when a strategy is made, not when it is drawn from; an invalid one raises an error of
`dynx.errors`.
"""

from importlib.util import find_spec

from dynx.errors import NotInstalledError

if find_spec("hypothesis") is None:
    raise NotInstalledError(
        "dynx.testing.strategies needs the package hypothesis, which is not installed; "
        'pip install "dynx[testing]" brings it'
    )

from dynx.testing.strategies.configurations import (
    Sample,
    accelerations,
    configurations,
    samples,
    velocities,
)
from dynx.testing.strategies.geometry import poses, quaternions, unit_vectors, vectors, wrenches
from dynx.testing.strategies.models import inertials, models
from dynx.testing.strategies.scenes import materials, scenes, shapes
from dynx.testing.strategies.urdf_text import urdf_text

__all__ = [
    "Sample",
    "accelerations",
    "configurations",
    "inertials",
    "materials",
    "models",
    "poses",
    "quaternions",
    "samples",
    "scenes",
    "shapes",
    "unit_vectors",
    "urdf_text",
    "vectors",
    "velocities",
    "wrenches",
]
