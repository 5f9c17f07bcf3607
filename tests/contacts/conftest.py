"""The world `exact`, whose motion is that of the closed forms, for tests that ask for it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from dynx.world import register_world, unregister_world
from tests.contacts.exact_world import ExactWorld


@pytest.fixture
def exact() -> Iterator[None]:
    """Offer the world `exact` during a test."""
    register_world("exact", lambda: ExactWorld)
    yield
    unregister_world("exact")
