"""Attacks by folders of training runs that are resumed: `dynx train --resume`."""

from __future__ import annotations

import io
import json
import os
import pickle
import shutil
import tempfile
import zipfile
from functools import cache
from pathlib import Path

import numpy as np

from tests.security.attack import Box, Deed, Harmful, archive_of, attacks_on, sparse
from tests.security.surfaces.policy import torch_file

attack = attacks_on("run folder")


def train_to(steps: int, folder: str, *, resume: bool = False) -> None:
    """Train until a number of steps, with a replay buffer and a checkpoint every 32 steps."""
    from dynx.training import Schedule, train
    from tests.training.runs import small_run

    spec = small_run(steps, algorithm="dqn", hyperparameters={"buffer_size": 100, "learning_starts": 8})
    schedule = Schedule(checkpoint_every=32, evaluate_every=1000, episodes=1)
    train(spec, folder, resume=resume, schedule=schedule, final_episodes=1)


@cache
def _trained() -> dict[str, bytes]:
    with tempfile.TemporaryDirectory() as folder:
        train_to(64, folder)
        found = Path(folder)
        return {
            path.relative_to(found).as_posix(): path.read_bytes()
            for path in found.rglob("*")
            if path.is_file()
        }


def run(box: Box) -> Path:
    """Put a run into the victim's folder."""
    for name, content in _trained().items():
        box.file(f"run/{name}", content)
    return box.here / "run"


RESUMED = Deed(("run",), "resumed")
GOES_ON = Deed(("run",), "resumed", ends=(0, 2))


def newest(folder: Path) -> Path:
    """Return the newest checkpoint of a run."""
    return sorted((folder / "checkpoints").glob("*.zip"))[-1]


def change_members(path: Path, **members: bytes) -> None:
    """Change members of a zip archive; ``_`` in a name stands for a dot."""
    with zipfile.ZipFile(path) as archive:
        given = {name: archive.read(name) for name in archive.namelist()}
    path.write_bytes(
        archive_of({**given, **{name.replace("_", "."): each for name, each in members.items()}})
    )


@attack("code", "pickle in the weights of a checkpoint")
def _(box: Box) -> Deed:
    change_members(newest(run(box)), policy_pth=torch_file(pickle.dumps(Harmful(box.owned), 2)))
    return RESUMED


@attack("code", "pickle in the replay buffer")
def _(box: Box) -> Deed:
    path = newest(run(box)).with_suffix(".npz")
    arrays = dict(np.load(path))
    arrays["rewards"] = np.array([Harmful(box.owned)], dtype=object)
    np.savez(path, **arrays)
    return RESUMED


@attack("code", "module in the task of the run")
def _(box: Box) -> Deed:
    box.file("planted.py", box.code)
    path = run(box) / "run.json"
    document = json.loads(path.read_text())
    document["spec"]["task"]["id"] = "planted:Own-v0"
    path.write_text(json.dumps(document))
    return RESUMED


@attack("link", "checkpoints in another folder")
def _(box: Box) -> Deed:
    folder = run(box)
    shutil.rmtree(folder / "checkpoints")
    (folder / "checkpoints").symlink_to(box.outside)
    return RESUMED


@attack("link", "final policy that leads outside")
def _(box: Box) -> Deed:
    path = run(box) / "final.zip"
    path.unlink()
    path.symlink_to(box.outside / "secret.txt")
    return RESUMED


@attack("link", "best policy that leads to a new file")
def _(box: Box) -> Deed:
    path = run(box) / "best.zip"
    path.unlink(missing_ok=True)
    path.symlink_to(box.outside / "new.zip")
    return RESUMED


@attack("link", "curve that is the same file as one outside")
def _(box: Box) -> Deed:
    path = run(box) / "curve.jsonl"
    path.unlink(missing_ok=True)
    os.link(box.outside / "secret.txt", path)
    return GOES_ON


@attack("link", "folder of curves for TensorBoard")
def _(box: Box) -> Deed:
    folder = run(box)
    (folder / "tensorboard").symlink_to(box.outside)
    return RESUMED


@attack("device", "endless device as the curve")
def _(box: Box) -> Deed:
    path = run(box) / "curve.jsonl"
    path.unlink(missing_ok=True)
    path.symlink_to("/dev/zero")
    return RESUMED


@attack("device", "pipes in the place of files")
def _(box: Box) -> Deed:
    folder = run(box)
    for name in ("evaluations.jsonl", "curve.jsonl", "final.zip"):
        (folder / name).unlink(missing_ok=True)
        os.mkfifo(folder / name)
    return RESUMED


@attack("device", "pipe as the checkpoint")
def _(box: Box) -> Deed:
    folder = run(box)
    for path in (folder / "checkpoints").iterdir():
        path.unlink()
        os.mkfifo(path)
    return RESUMED


@attack("bomb", "sparse description of the run")
def _(box: Box) -> Deed:
    sparse(run(box) / "run.json", 2**36)
    return RESUMED


@attack("bomb", "compressed replay buffer")
def _(box: Box) -> Deed:
    path = newest(run(box)).with_suffix(".npz")
    np.savez_compressed(path, **{**dict(np.load(path)), "more": np.zeros(2 * 10**8)})
    return RESUMED


@attack("bomb", "sparse replay buffer")
def _(box: Box) -> Deed:
    path = newest(run(box)).with_suffix(".npz")
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("pos.npy", b"x")
    sparse(path, 2**36, content.getvalue())
    return RESUMED


@attack("recursion", "deep lines of the curve")
def _(box: Box) -> Deed:
    (run(box) / "curve.jsonl").write_text("[" * 10**5 + "\n" + '{"steps": ' * 10**5)
    return GOES_ON


@attack("recursion", "deep description of the run")
def _(box: Box) -> Deed:
    (run(box) / "run.json").write_text('{"spec": ' * 10**5)
    return RESUMED


@attack("type", "lines of the evaluations with other types")
def _(box: Box) -> Deed:
    lines = [
        '{"steps": 1, "mean": "x"}',
        '{"steps": 2, "mean": [1]}',
        '{"steps": 3, "mean": 1e999}',
        "[1]",
        "NaN",
    ]
    (run(box) / "evaluations.jsonl").write_text("\n".join([*lines, '{"steps": 1' + "0" * 4000 + "}"]))
    return GOES_ON


@attack("type", "files that are folders, and a folder that is a file")
def _(box: Box) -> Deed:
    folder = run(box)
    (folder / "curve.jsonl").unlink(missing_ok=True)
    (folder / "curve.jsonl").mkdir()
    return RESUMED


@attack("type", "file in the place of the checkpoints")
def _(box: Box) -> Deed:
    folder = run(box)
    shutil.rmtree(folder / "checkpoints")
    (folder / "checkpoints").write_text("x")
    return RESUMED


@attack("type", "final policy that is a folder")
def _(box: Box) -> Deed:
    path = run(box) / "final.zip"
    path.unlink()
    path.mkdir()
    return RESUMED


@attack("terminal", "escape sequences in the description of the run")
def _(box: Box) -> Deed:
    path = run(box) / "run.json"
    document = json.loads(path.read_text())
    document["spec"]["algorithm"] = "\x1b[2Jdqn\u202e\n"
    path.write_text(json.dumps(document))
    return RESUMED


@attack("printf", "formats in the description of the run")
def _(box: Box) -> Deed:
    path = run(box) / "run.json"
    document = json.loads(path.read_text())
    document["spec"]["hyperparameters"] = {"%s%n{0.__class__}": "%d"}
    path.write_text(json.dumps(document))
    return RESUMED
