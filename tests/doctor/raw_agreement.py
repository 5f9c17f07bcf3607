"""Running the raw scripts: mended files through Pinocchio and PyBullet, each in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dynx.doctor.truth import TILTED, draw_states, free_model
from dynx.model.model import Base
from dynx.model.xml_source import XmlSource

SCRIPTS = {name: Path(__file__).with_name(f"raw_{name}.py") for name in ("pinocchio", "pybullet")}


def beside(original: Path, data: bytes, folder: Path) -> Path:
    """A file in the place of `original` in a copy, made of links, of the collection that it is from.

    PyBullet refuses a file whose meshes it does not find, and it looks for them from the file upwards.
    """
    tops = [each for each in original.parents if each.name in ("share", "pybullet_data")]
    top = tops[0] if tops else original.parent
    here, copy = top, folder
    for step in original.relative_to(top).parts:
        copy.mkdir(exist_ok=True)
        for entry in here.iterdir():
            if entry.name != step and not (copy / entry.name).exists():
                (copy / entry.name).symlink_to(entry)
        here, copy = here / step, copy / step
    copy.write_bytes(data)
    return copy


def task(path: Path, base: Base, samples: int = 3, seed: int = 1) -> dict[str, Any]:
    """What the scripts are asked about a file: names and states, from dynx's reading of it."""
    model = free_model(XmlSource(path.read_bytes(), str(path)), base)
    states = draw_states(model, samples, seed)
    start = 7 if model.floating else 0
    return {
        "path": str(path),
        "floating": model.floating,
        "joints": list(model.joint_names),
        "links": [link.name for link in model.links],
        "gravity": list(TILTED),
        "states": [
            {
                "base": q[:7].tolist() if start else None,
                "q": q[start:].tolist(),
                "v": v.tolist(),
                "a": a.tolist(),
            }
            for q, v, a in zip(states.q, states.v, states.a, strict=True)
        ],
    }


def answers(engine: str, tasks: Sequence[dict[str, Any]], folder: Path) -> list[Any]:
    """What one engine says, in a process without dynx."""
    questions, found = folder / f"{engine}_tasks.json", folder / f"{engine}_answers.json"
    questions.write_text(json.dumps(list(tasks)), encoding="utf-8")
    subprocess.run(
        [sys.executable, str(SCRIPTS[engine]), str(questions), str(found)], check=True, capture_output=True
    )
    loaded: list[Any] = json.loads(found.read_text(encoding="utf-8"))
    return loaded


def difference(one: Any, other: Any) -> float:
    """Largest relative difference of poses, mass matrix and torque; infinite where one refused."""
    if "error" in one or "error" in other:
        return float("inf")
    worst = 0.0
    for quantity in ("poses", "M", "tau"):
        mine, theirs = (np.array([state[quantity] for state in each]) for each in (one, other))
        size = float(np.max(np.abs(mine), initial=0.0))
        gap = float(np.max(np.abs(mine - theirs), initial=0.0))
        worst = max(worst, gap / size if size else gap)
    return worst
