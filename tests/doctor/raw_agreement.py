"""Runs of the scripts without dynx: mended files in Pinocchio and PyBullet, each in its own process."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from dynx.agreement.tolerances import BAR
from dynx.doctor.examine.engine_input import without_meshes
from dynx.doctor.examine.reference_values import TILTED_GRAVITY, draw_states, model_without_mimics
from dynx.model.model import Base
from dynx.model.xml.source import XmlSource

SCRIPTS = {name: Path(__file__).with_name(f"raw_{name}.py") for name in ("pinocchio", "pybullet")}


def beside(original: Path, data: bytes, folder: Path) -> Path:
    """Write a file at the place of `original` in a copy, made of symbolic links, of its collection.

    PyBullet refuses a file whose meshes it does not find, and it looks for them from the file upwards.
    """
    tops = [each for each in original.parents if each.name in ("share", "pybullet_data")]
    top = tops[0] if tops else original.parent
    here, copy = top, folder
    for step in original.relative_to(top).parts:
        if copy.is_symlink():
            copy.unlink()
        if not copy.exists():
            copy.mkdir()
            for entry in here.iterdir():
                (copy / entry.name).symlink_to(entry)
        here, copy = here / step, copy / step
    if copy.is_symlink():
        copy.unlink()
    copy.write_bytes(data)
    return copy


def task(path: Path, base: Base, samples: int = 3, seed: int = 1) -> dict[str, Any]:
    """Make the task of the scripts for a file: names and states, as dynx reads it."""
    model = model_without_mimics(XmlSource(path.read_bytes(), str(path)), base)
    states = draw_states(model, samples, seed)
    start = 7 if model.floating else 0
    return {
        "path": str(path),
        "floating": model.floating,
        "joints": list(model.joint_names),
        "links": [link.name for link in model.links],
        "gravity": list(TILTED_GRAVITY),
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


def run_script(engine: str, tasks: Sequence[dict[str, Any]], folder: Path) -> list[Any]:
    """Run one engine in a process without dynx."""
    inputs, found = folder / f"{engine}_tasks.json", folder / f"{engine}_results.json"
    inputs.write_text(json.dumps(list(tasks)), encoding="utf-8")
    subprocess.run(
        [sys.executable, str(SCRIPTS[engine]), str(inputs), str(found)], check=True, capture_output=True
    )
    loaded: list[Any] = json.loads(found.read_text(encoding="utf-8"))
    return loaded


def difference(one: Any, other: Any) -> float:
    """Largest relative difference of poses, mass matrix and torque; infinite where one refused."""
    if "error" in one or "error" in other:
        return float("inf")
    largest = 0.0
    for quantity in ("poses", "M", "tau"):
        mine, theirs = (np.array([state[quantity] for state in each]) for each in (one, other))
        size = float(np.max(np.abs(mine), initial=0.0))
        gap = float(np.max(np.abs(mine - theirs), initial=0.0))
        largest = max(largest, gap / size if size else gap)
    return largest


def check_files(entries: Sequence[dict[str, Any]], folder: Path, shapes: bool) -> list[tuple[float, str]]:
    """Measure the differences of the engines on each mended file, or the message where one refuses it."""
    tasks = []
    for entry in entries:
        source = XmlSource(Path(entry["mended"]).read_bytes(), entry["path"])
        data = (source if shapes else without_meshes(source)).to_bytes()
        place = beside(Path(entry["path"]), data, folder / f"{entry['base']}-{shapes}")
        tasks.append(task(place, entry["base"]))
    with ThreadPoolExecutor(2) as pool:
        one, other = pool.map(lambda engine: run_script(engine, tasks, folder), SCRIPTS)
    messages = [[each["error"] for each in pair if "error" in each] for pair in zip(one, other, strict=True)]
    return [
        (difference(first, second), "; ".join(words))
        for first, second, words in zip(one, other, messages, strict=True)
    ]


def main() -> None:
    """Check every file that ``python docs/survey.py --json SURVEY --mended FOLDER`` mended.

    A file whose meshes are not in its collection, which PyBullet refuses before and after, is checked
    without them.
    """
    entries = [entry for entry in json.loads(Path(sys.argv[1]).read_text("utf-8")) if entry.get("mended")]
    with TemporaryDirectory(prefix="dynx-") as folder:
        found = check_files(entries, Path(folder), shapes=True)
        refused = [k for k, (gap, _) in enumerate(found) if not np.isfinite(gap)]
        again = check_files([entries[k] for k in refused], Path(folder), shapes=False)
    for k, result in zip(refused, again, strict=True):
        name = Path(entries[k]["path"]).name
        print(f"{name}, {entries[k]['base']}: {found[k][1]}; without meshes: {result[0]:.1e} {result[1]}")
        found[k] = result
    apart = [gap for gap, _ in found]
    for entry, (gap, words) in zip(entries, found, strict=True):
        if not gap <= BAR:
            print(f"DIFFERS: {Path(entry['path']).name}, {entry['base']}: {gap:.1e} {words}")
    print(f"{sum(gap <= BAR for gap in apart)} of {len(apart)} agree within {BAR:g}")
    print(f"largest of those: {max(gap for gap in apart if gap <= BAR):.1e}")


if __name__ == "__main__":
    main()
