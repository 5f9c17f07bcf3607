"""Mended files in the engines without dynx: each engine is a script that runs in a process of its own."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.surveys.files import Entry, read_entries
from dynx.agreement.tolerances import BAR
from dynx.doctor.examination import TILTED_GRAVITY, draw_states, model_without_mimics, without_meshes
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource

ENGINES = ("pinocchio", "pybullet", "mujoco", "drake")
SCRIPT = Path(__file__).with_name("raw_engine.py")


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
        "root": model.root,
        "load": "",
        "calls": [],
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
    """Run one engine in a process without dynx; a task with which the process ends has an error."""
    inputs, found = folder / f"{engine}_tasks.json", folder / f"{engine}_results.json"
    inputs.write_text(json.dumps(list(tasks)), encoding="utf-8")
    command = [sys.executable, str(SCRIPT), engine, str(inputs), str(found)]
    if subprocess.run(command, check=False, capture_output=True, cwd=folder).returncode == 0:
        loaded: list[Any] = json.loads(found.read_text(encoding="utf-8"))
        return loaded
    if len(tasks) == 1:
        return [{"error": "the process ended"}]
    half = len(tasks) // 2
    return run_script(engine, tasks[:half], folder) + run_script(engine, tasks[half:], folder)


def difference(one: Any, other: Any, quantities: Sequence[str] = ("poses", "M", "tau")) -> float:
    """Largest relative difference of poses, mass matrix and torque; infinite where one refused.

    Links that one of them lacks, because it merges them into others, are left out.
    """
    if "error" in one or "error" in other:
        return float("inf")
    largest = 0.0
    for quantity in quantities:
        rows = [
            pair
            for ours, others in zip(one, other, strict=True)
            for pair in zip(ours[quantity], others[quantity], strict=True)
            if None not in pair
        ]
        mine, theirs = (np.array([pair[k] for pair in rows]) for k in (0, 1))
        size = float(np.max(np.abs(mine), initial=0.0))
        gap = float(np.max(np.abs(mine - theirs), initial=0.0))
        largest = max(largest, gap / size if size else gap)
    return largest


def check_entries(entries: Sequence[Entry], folder: Path) -> list[dict[str, tuple[float, str]]]:
    """Measure the difference of each engine from Pinocchio on each mended file, and the message of a refusal.

    Engines load the file by the printed call, with the printed lines of code, and without meshes, for which
    each looks in another place.
    """
    tasks: dict[str, list[dict[str, Any]]] = {engine: [] for engine in ENGINES}
    for number, entry in enumerate(entries):
        source = without_meshes(XmlSource(Path(entry["mended"]).read_bytes(), entry["path"]))
        place = folder / f"{number}.urdf"
        place.write_bytes(source.to_bytes())
        plain = task(place, entry["base"])
        loads = {each["engine"]: each["call"] for each in entry["engines"]}
        for engine in ENGINES:
            calls = [each["code"] for each in entry["calls"] if each["engine"] == engine]
            tasks[engine].append({**plain, "load": loads.get(engine, ""), "calls": calls})
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(lambda engine: run_script(engine, tasks[engine], folder), ENGINES))
    found = []
    for entry, *answers in zip(entries, *results, strict=True):
        # Only kinematics can be compared of a file without inertial data.
        massless = any(each["rule"] == "DX118" for each in entry["findings"])
        quantities = ("poses",) if massless else ("poses", "M", "tau")
        found.append(
            {
                engine: (
                    difference(answers[0], each, quantities),
                    "" if isinstance(each, list) else each["error"],
                )
                for engine, each in zip(ENGINES, answers, strict=True)
            }
        )
    return found


def main() -> None:
    """Check every file that ``benchmarks.surveys.files --json RESULTS --mended FOLDER`` mended."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path, help="results of the survey")
    parser.add_argument("--within", type=float, default=BAR, help="largest relative difference")
    parser.add_argument("--json", type=Path, help="file for the differences")
    options = parser.parse_args()
    entries = [entry for entry in read_entries(options.results) if entry.get("mended")]
    with TemporaryDirectory(prefix="dynx-") as folder:
        found = check_entries(entries, Path(folder))
    verdicts = []
    for entry, of_engines in zip(entries, found, strict=True):
        refusing = [
            each["engine"] for each in entry["engines"] if each["refused_after"] or each["not_used_after"]
        ]
        messages = {
            engine: message or f"{gap:.1e}"
            for engine, (gap, message) in of_engines.items()
            if engine not in refusing and not gap <= options.within
        }
        verdicts.append(
            {"path": entry["path"], "base": entry["base"], "refusing": refusing, "apart": messages}
        )
        for engine, message in messages.items():
            print(f"DIFFERS: {entry['path']}, {entry['base']}: {engine} {message[:200]}")
    for whole in (True, False):
        of = [each for each in verdicts if whole == (not each["refusing"])]
        what = "that all engines load" if whole else "on which an engine is of no use, as the report states"
        alike = sum(not each["apart"] for each in of)
        print(f"files {what}: {alike} of {len(of)} alike within {options.within:g}")
    if options.json:
        options.json.write_text(json.dumps(verdicts), encoding="utf-8")


if __name__ == "__main__":
    main()
