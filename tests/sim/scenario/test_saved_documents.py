"""Documents of scenarios that an earlier dynx wrote are read, and simulate to the same numbers.

`scenarios_before_options.json.gz` was written when each function repeated the list of options: one
document for every controller, kind of reference and field, and the last q, v and torque of its rollout.
"""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.model.library import example_roots
from dynx.sim import Scenario, ScenePlant, simulate
from dynx.sim.scenario.options import OPTIONS, Kind, Parts, PlantKind

FILE = Path(__file__).with_name("scenarios_before_options.json.gz")
ROBOTS = next(iter(example_roots()), Path("absent"))
TEXT = gzip.decompress(FILE.read_bytes()).decode().replace("{example-robot-data}", ROBOTS.parent.as_posix())
SAVED: dict[str, Any] = json.loads(TEXT)
ADDED: dict[str, Any] = {"sensors": []}
"""Options that were added since, with their defaults."""


def document_of(name: str) -> Any:
    """Return a document; skip the test where the engine of its controller is not installed."""
    document = SAVED["documents"][name]
    if "'pinocchio'" in repr(document) and "pinocchio" not in installed_backends():
        pytest.skip("needs Pinocchio")
    return document


@pytest.mark.parametrize("name", SAVED["documents"])
def test_a_saved_document_is_read_and_written_alike(name: str) -> None:
    """Classes may have got another name since; numbers and text are the same."""
    document = document_of(name)
    scenario = Scenario.from_dict(document)
    written = json.loads(scenario.to_json())
    assert Scenario.from_dict(written) == scenario
    assert written.keys() == document.keys() | ADDED.keys()
    assert {key: written[key] for key in ADDED} == ADDED
    objects = {"controller", "reference", *(each for each in OPTIONS if has_objects(OPTIONS[each].kind))}
    assert [key for key in document if key not in objects and written[key] != document[key]] == []


def has_objects(kind: Kind) -> bool:
    """Check whether values of a kind of options can be objects of classes."""
    return isinstance(kind, Parts | PlantKind)


@pytest.mark.parametrize("name", SAVED["ends"])
def test_a_saved_scenario_ends_where_it_did(name: str) -> None:
    scenario = Scenario.from_dict(document_of(name))
    engine = scenario.plant.engine if isinstance(scenario.plant, ScenePlant) else scenario.plant
    if engine not in installed_backends():
        pytest.skip(f"{engine} is not installed")
    if isinstance(scenario.plant, ScenePlant) and not ROBOTS.exists():
        pytest.skip("needs the meshes of example-robot-data")
    rollout = simulate(scenario)
    for ours, saved in zip((rollout.q, rollout.v, rollout.tau), SAVED["ends"][name], strict=True):
        size = max(1.0, float(np.max(np.abs(saved), initial=0.0)))
        np.testing.assert_allclose(ours[-1], saved, rtol=0.0, atol=1e-12 * size)
