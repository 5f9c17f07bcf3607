"""Ctrl-C during a measurement: the results so far are kept where the caller asks for them."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from dynx.contacts import conform
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]

pytestmark = pytest.mark.skipif(not ENGINES, reason="needs an engine for worlds")


def interrupt(done: int, total: int) -> None:
    """Interrupt after two runs."""
    if done == 2:
        raise KeyboardInterrupt


def test_an_interruption_keeps_the_trials_that_are_done() -> None:
    found = conform(
        ENGINES[:1],
        (4e-3,),
        ["resting_force", "slope"],
        jobs=0,
        progress=interrupt,
        interruptible=True,
    )
    # Of one trial of the first case and two of the second, the last is left out. What stays is not judged,
    # because no setting could be tried.
    assert {each.case for each in found.results} == {"resting_force"}
    assert found.not_done >= 1
    assert not found.failures
    assert not found.unexplained
    assert found.versions[ENGINES[0]]


def test_an_interruption_is_raised_where_nobody_asks_for_the_results() -> None:
    with pytest.raises(KeyboardInterrupt):
        conform(ENGINES[:1], (4e-3,), ["resting_force", "slope"], jobs=0, progress=interrupt)
