"""Damaged, truncated and crafted records: one error of dynx, and nothing that they name is read."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import ExternalForce, trajectory
from dynx.control import ComputedTorque
from dynx.errors import ArgumentError, DynxError
from dynx.files.arrays import read_arrays, write_arrays
from dynx.model.loading import load
from dynx.sim import Noise, Payload, Rollout, Scenario, simulate, simulate_batch
from dynx.sim.batch import OutcomeStore
from dynx.sim.batch_rollouts import BatchRollouts

ARM = load("planar_2r")
SCENARIO = Scenario(
    ARM,
    ComputedTorque(ARM, kp=400, kd=40, backend="reference"),
    trajectory.cycloidal(np.zeros(2), np.full(2, 0.05), duration=0.006),
    plant="compiled",
    noise=Noise(q=1e-5),
    pushes=[ExternalForce("upper_arm", [1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, 0.002)],
    payload=Payload("forearm", 1.0, [0.0, 0.0, 0.0]),
    check_reference=False,
)
LOADERS: dict[str, Callable[[Path], Any]] = {"rollout": Rollout.load, "batch": BatchRollouts.load}
TEXTS = {"rollout": "robot", "batch": "scenario"}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("records")
    found = {kind: folder / f"{kind}.npz" for kind in LOADERS}
    simulate(SCENARIO).save(found["rollout"])
    simulate_batch(SCENARIO, rollouts=3, record_every=2, keep=folder / "kept").save(found["batch"])
    return found


def outcome(kind: str, path: Path) -> Any:
    """Return what a file loads as, or the one error that may come instead."""
    try:
        return LOADERS[kind](path)
    except ArgumentError as error:
        return error


@pytest.mark.parametrize("kind", LOADERS)
def test_bytes_that_are_changed_or_missing(files: dict[str, Path], tmp_path: Path, kind: str) -> None:
    written, path, refused = files[kind].read_bytes(), tmp_path / "record.npz", 0
    for place in np.linspace(0, len(written) - 1, 150).astype(int).tolist():
        for data in (
            written[:place],
            written[:place] + bytes([written[place] ^ 0x55]) + written[place + 1 :],
        ):
            path.write_bytes(data)
            found = outcome(kind, path)
            refused += isinstance(found, ArgumentError)
    assert refused > 250


ODD = st.sampled_from(
    [
        *(None, True, -1, 3, 1e300, 10**400, "", "x", "/etc/passwd", "<robot/>", [], [1], [[1], [1, 2]], {}),
        *({"float": "x"}, {"array": [[1], [1, 2]]}, {"mapping": [[[1], 2]]}, {"model": "of the scenario"}),
        *({"class": "dynx.sim.plants.disturbances:Push", "fields": {}}, {"class": "x:y", "fields": 3}),
        {"class": "dynx.model.model:Model", "fields": {"name": 1, "links": 2, "joints": 3}},
        {"fingerprint": "a:b", "sha256": 0},
        {"class": "x:y", "fields": {}, "code": 3},
        {"controller": {"controller": "PD"}, "model": {}},
    ]
)


USES: list[Callable[[Rollout], Any]] = [
    lambda rollout: simulate(SCENARIO, resume=rollout, step=3),
    lambda rollout: json.dumps(rollout.settings),
    lambda rollout: rollout.scenario == SCENARIO,
    lambda rollout: repr(rollout) + str(rollout.summary()) + rollout._repr_html_(),
    lambda rollout: None if rollout.scenario is None else simulate(replace(rollout.scenario, duration=2e-3)),
]


CRAFTED = [
    ("integrator", {"array": [1.0, 2.0]}),
    ("integrator", {"fingerprint": "a:b", "sha256": "0"}),
    ("substeps", 10**400),
    ("noise", {"fingerprint": "a:b", "sha256": "0"}),
    ("controller", {"fingerprint": "a:b", "sha256": "0", "numbers": 3}),
    ("reference", {"fingerprint": "a:b", "sha256": "0", "duration": [1]}),
    ("reference.fields.duration", None),
    ("reference.fields.start.fields.q", [[1], [1, 2]]),
    ("reference.fields.curve", {"array": ["nan", "inf"]}),
    ("controller.controller.backend", {"fingerprint": "a:b", "sha256": "0", "numbers": 3}),
    ("payload", [{"fingerprint": "a:b", "sha256": "0"}]),
    ("pushes", [{"class": "x:y", "fields": {}}]),
]


@pytest.mark.parametrize(("place", "odd"), CRAFTED, ids=range(len(CRAFTED)))
def test_crafted_provenance_gives_errors_of_dynx(place: str, odd: Any) -> None:
    document = SCENARIO.to_dict()
    *path, last = place.split(".")
    holder = document
    for key in path:
        holder = holder[key]
    holder[last] = odd
    try:
        found = replace(simulate(SCENARIO), scenario=Scenario.from_dict(document))
    except ArgumentError:
        return
    for use in USES:
        with suppress(DynxError):
            use(found)


def places(document: Any) -> Iterator[tuple[Any, Any]]:
    """Yield every part of a document as the list or dict that holds it, and its key there."""
    for key in document if isinstance(document, dict) else range(len(document)):
        yield document, key
        if isinstance(document[key], dict | list):
            yield from places(document[key])


@pytest.mark.parametrize("kind", LOADERS)
@given(data=st.data())
def test_documents_with_odd_parts(
    files: dict[str, Path], tmp_path_factory: pytest.TempPathFactory, kind: str, data: st.DataObject
) -> None:
    """A checksum protects from damage, not from a file that was made to do harm."""
    path = tmp_path_factory.getbasetemp() / f"odd_{kind}.npz"
    content = read_arrays(files[kind], "a record")
    document = json.loads(content.texts[TEXTS[kind]])
    for _ in range(data.draw(st.integers(1, 2))):
        holder, key = data.draw(st.sampled_from(list(places(document))))
        holder[key] = data.draw(ODD)
    text = json.dumps(document)
    write_arrays(path, {**content.arrays, **content.texts, TEXTS[kind]: text})
    found = outcome(kind, path)
    if isinstance(found, Rollout):
        for use in USES:
            with suppress(DynxError):
                use(found)


def test_a_record_names_no_other_file(files: dict[str, Path], tmp_path: Path) -> None:
    other = tmp_path / "other.urdf"
    other.write_text(ARM.to_urdf())
    macro = tmp_path / "other.xacro"
    macro.write_text(ARM.to_urdf())
    for kind in LOADERS:
        content = read_arrays(files[kind], "a record")
        for named in (str(other), str(macro), "planar_2r", "~/robot.urdf"):
            document = json.loads(content.texts[TEXTS[kind]])
            (document if kind == "rollout" else document["model"]["model"])["urdf"] = named
            write_arrays(
                tmp_path / "x.npz", {**content.arrays, **content.texts, TEXTS[kind]: json.dumps(document)}
            )
            with pytest.raises(ArgumentError, match="cannot be read: "):
                LOADERS[kind](tmp_path / "x.npz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")
@pytest.mark.parametrize("kind", LOADERS)
def test_pipes_and_devices_are_not_waited_for(tmp_path: Path, kind: str) -> None:
    os.mkfifo(tmp_path / "pipe.npz")
    for path in (tmp_path / "pipe.npz", Path("/dev/zero"), tmp_path):
        with pytest.raises(ArgumentError, match="; wanted a"):
            LOADERS[kind](path)


def test_damaged_parts_are_computed_again(files: dict[str, Path], tmp_path: Path) -> None:
    def run() -> BatchRollouts:
        return simulate_batch(SCENARIO, rollouts=3, record_every=2, keep=tmp_path)

    whole = run()
    (part,) = tmp_path.iterdir()
    written = part.read_bytes()
    damages = [written[:place] for place in range(0, len(written), 401)]
    damages += [written[:k] + bytes([written[k] ^ 1]) + written[k + 1 :] for k in range(0, len(written), 401)]
    content = read_arrays(part, "a part")
    for damage in damages:
        part.write_bytes(damage)
        np.testing.assert_array_equal(run().q_record, whole.q_record)
    for name, array in content.arrays.items():
        write_arrays(part, {**content.arrays, name: array[:1]})
        np.testing.assert_array_equal(run().q_record, whole.q_record)
        assert len(read_arrays(part, "a part").arrays[name]) == len(array)


def test_a_part_that_cannot_be_stored_is_in_the_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, arrays: Any) -> None:
        raise ArgumentError(f"{path} cannot be written: no space left")

    monkeypatch.setattr("dynx.sim.batch.write_arrays", full)
    with pytest.warns(RuntimeWarning, match="1 parts of the batch could not be stored.*no space left"):
        found = simulate_batch(SCENARIO, rollouts=3, keep=tmp_path)
    assert found.done.all()


def test_a_batch_that_cannot_be_written_leaves_the_old_file(files: dict[str, Path], tmp_path: Path) -> None:
    rollouts, path = BatchRollouts.load(files["batch"]), tmp_path / "batch.npz"
    path.write_bytes(b"older")
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(ArgumentError, match="cannot be written"):
            rollouts.save(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert [(each.name, each.read_bytes()) for each in tmp_path.iterdir()] == [("batch.npz", b"older")]


def test_a_folder_that_cannot_hold_parts(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    for folder in (tmp_path / "file", tmp_path / "a\0b"):
        with pytest.raises(ArgumentError, match="keep is"):
            OutcomeStore(folder, SCENARIO)
