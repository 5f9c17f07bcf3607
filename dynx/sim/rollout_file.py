"""Rollouts in files: NumPy's ``.npz`` with a schema, which keeps every bit, and ``.csv``."""

from __future__ import annotations

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.model.loading import load as load_model
from dynx.sim.rollout import Rollout
from dynx.trajectory.base import Setpoint

SCHEMA = "dynx.rollout/1"
"""What the file says it is; another number means another layout."""

ARRAYS = ("t", "q", "v", "a", "tau", "saturated", "rotors")
REFERENCE = ("reference_q", "reference_v", "reference_a")


def save(rollout: Rollout, path: str | os.PathLike[str]) -> None:
    """Write `rollout` in the format that the name ends with. Raises ArgumentError for another."""
    target = Path(path)
    if target.suffix == ".npz":
        _save_npz(rollout, target)
    elif target.suffix == ".csv":
        _save_csv(rollout, target)
    else:
        raise ArgumentError(f"a rollout is saved as .npz or .csv, not as {shown(target.name)}")


def load(path: str | os.PathLike[str]) -> Rollout:
    """Read a ``.npz`` that `save` wrote. Raises ArgumentError for any other file.

    The model comes back from the URDF text in the file; arrays are read without unpickling anything.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            entries = {name: file[name] for name in file.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise ArgumentError(f"{os.fspath(path)} cannot be read as a rollout: {error}") from error
    if str(entries.get("schema")) != SCHEMA:
        raise ArgumentError(f"{os.fspath(path)} does not say {SCHEMA!r}, so it is no rollout of this version")
    missing = [name for name in (*ARRAYS, "robot") if name not in entries]
    if missing:
        raise ArgumentError(f"{os.fspath(path)} lacks {', '.join(missing)}")
    robot: dict[str, Any] = json.loads(str(entries["robot"]))
    reference = None
    if all(name in entries for name in REFERENCE):
        reference = Setpoint(*(entries[name] for name in REFERENCE))
    return Rollout(
        load_model(robot["urdf"], base=robot["base"], gravity=robot["gravity"]),
        reference=reference,
        settings=robot["settings"],
        **{name: entries[name] for name in ARRAYS},
    )


def _save_npz(rollout: Rollout, path: Path) -> None:
    model = rollout.model
    robot = {
        "urdf": model.to_urdf(),
        "base": model.base,
        "gravity": list(model.gravity),
        "settings": rollout.settings,
    }
    arrays: dict[str, Any] = {name: getattr(rollout, name) for name in ARRAYS}
    if rollout.reference is not None:
        arrays.update(zip(REFERENCE, rollout.reference, strict=True))
    # The energy is for readers without dynx; `load` computes it again.
    np.savez(path, schema=SCHEMA, robot=json.dumps(robot), energy=rollout.energy, **arrays)


def _save_csv(rollout: Rollout, path: Path) -> None:
    """A row for each state; what acted from then on beside it, empty in the last row."""
    model = rollout.model
    base_q = ["x", "y", "z", "qx", "qy", "qz", "qw"] if model.floating else []
    base_v = ["vx", "vy", "vz", "wx", "wy", "wz"] if model.floating else []
    positions = [*base_q, *model.joint_names]
    rates = [*base_v, *model.joint_names]
    columns = ["t", *(f"q:{name}" for name in positions), *(f"v:{name}" for name in rates)]
    blocks = [rollout.t[:, None], rollout.q, rollout.v]
    if rollout.reference is not None:
        columns += [f"q*:{name}" for name in positions] + [f"error:{name}" for name in rates]
        blocks += [rollout.reference.q, rollout.error]
    columns += [f"a:{name}" for name in rates] + [f"tau:{name}" for name in rates]
    states = np.concatenate(blocks, axis=1)
    acting = np.concatenate([rollout.a, rollout.tau], axis=1)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(",".join(_quoted(column) for column in columns) + "\n")
        for k, state in enumerate(states):
            numbers = [repr(x) for x in state.tolist()]
            numbers += [repr(x) for x in acting[k].tolist()] if k < len(acting) else [""] * acting.shape[1]
            file.write(",".join(numbers) + "\n")


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n\r') else text
