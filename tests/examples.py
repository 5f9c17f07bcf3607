"""Number of examples of a property of one robot: a quarter of those of a property of all robots."""

from __future__ import annotations

import numpy as np
from hypothesis import settings

from dynx.model import Model
from dynx.spatial.scalar import Floats

ENOUGH = 25
"""Number of examples with which the tests caught each of 194 slips planted in the source by hand."""

PROFILE = settings().max_examples

one_robot = settings(max_examples=min(PROFILE, max(ENOUGH, PROFILE // 4)))
"""For an identity in q, v and a of a given robot. Both sides are polynomials in these and in sines and
cosines of q: where they differ at all they differ almost everywhere, so that further states tell little,
whereas a further robot may be of a kind that was not met."""


def generic_sample(model: Model) -> tuple[Floats, Floats, Floats]:
    """Return q, v, a without zeros or symmetries, as an explicit example: most drawn states have some."""
    rng = np.random.default_rng(1)
    v, a = rng.uniform(0.5, 1.5, (2, model.nv)) * rng.choice((-1.0, 1.0), (2, model.nv))
    return model.random(rng), v, a
