"""Hypothesis profiles: ``ci`` (200 examples of each property, the default), ``dev`` (20, for a quick
look) and ``faults`` (25, not shrunk: `tests.faults` asks only whether a test fails);
``pytest --hypothesis-profile dev`` or ``HYPOTHESIS_PROFILE=dev`` chooses.

Examples are drawn from a fixed seed, so a failure in CI is a failure everywhere; no deadline, since
the time of one example says more about the machine than about dynx.
"""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, Phase, settings

settings.register_profile(
    "ci",
    max_examples=200,
    deadline=None,
    derandomize=True,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("dev", parent=settings.get_profile("ci"), max_examples=20)
settings.register_profile(
    "faults",
    parent=settings.get_profile("ci"),
    max_examples=25,
    phases=[Phase.explicit, Phase.generate],
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What takes longest comes first, so that parallel workers end together."""
    items.sort(key=lambda item: not item.nodeid.startswith("tests/properties/"))
