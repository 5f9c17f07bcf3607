"""Survey of robot files: the doctor's report on each, and the engines that load a file which dynx refuses.

    python -m benchmarks.surveys.files FOLDER_OR_LIST [--base fixed] [--engines a,b] [--jobs N]
        [--json OUT.jsonl] [--mended FOLDER] [--fix-tolerance 1e-9] [--seconds LIMIT]

A list is a text file with one path per line. Files in MJCF and SDF state their base and are examined with
that one. Each file is examined in a worker process with a time limit, so
that an engine that crashes costs one file. One line of JSON per file and base is appended to ``--json``, and
files that it already has are not examined again. ``--mended`` keeps the corrected files, mended as by
``dynx doctor --fix`` with ``--fix-tolerance``. ``python -m benchmarks.surveys.raw_agreement OUT.jsonl``
compares them in engines without dynx, ``python -m benchmarks.surveys.same_robot OUT.jsonl`` with the files.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dynx.cli.doctor.run import FIX_TOLERANCE
from dynx.doctor import diagnose
from dynx.doctor.examination import temporary_document, without_meshes
from dynx.engines.silence import silence
from dynx.errors import DynxError
from dynx.loaded import installed_engines
from dynx.loaded.registry import loader_class
from dynx.model.document_format import Format, format_of_root
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.workers import Workers

SMALL = 1e-6
"""Relative difference below which robots are counted separately, as differences of rounding."""

SECONDS = 300.0
"""Time limit [s] of the examination of one file on one base."""

LOADING_SECONDS = 60.0
"""Time limit [s] of one engine for loading a file that dynx refuses."""

Entry = dict[str, Any]


@dataclass(frozen=True)
class Task:
    """One file on one base, None for that of the file; `mended` is the folder of corrected files, for
    `fix_tolerance` of `diagnose`."""

    path: str
    base: Base | None
    engines: tuple[str, ...] | None = None
    mended: str | None = None
    fix_tolerance: float | None = None


@dataclass(frozen=True)
class Loading:
    """One file that one engine loads by itself."""

    path: str
    engine: str


def examine(task: Task) -> Entry:
    """Make the entry of a file: its report, its path, and the path of the corrected file."""
    report = diagnose(
        task.path,
        base=task.base,
        engines=task.engines,
        counterexamples=False,
        fix_tolerance=task.fix_tolerance,
    )
    entry = report.to_dict()
    entry["path"] = task.path
    for bulky in ("pairs", "model_difference"):
        del entry[bulky]
    if task.mended and report.error is None:
        digest = hashlib.sha256(task.path.encode()).hexdigest()[:16]
        where = Path(task.mended) / f"{task.base or 'own'}-{digest}{Path(task.path).suffix}"
        text = report.mended if report.mended is not None else report.text
        where.write_text(text or "", encoding="utf-8")
        entry["mended"] = str(where)
    return entry


def load_alone(task: Loading) -> str | None:
    """Load a file by an engine's documented call, or without its meshes; return the message of a refusal."""
    path = Path(task.path)
    message = _call(task.engine, path)
    if message is not None:
        try:
            slim = without_meshes(XmlSource(path.read_bytes(), str(path)))
        except DynxError:
            return message
        with temporary_document(slim) as copy:
            message = _call(task.engine, copy)
    return message


def _call(engine: str, path: Path) -> str | None:
    names: dict[str, Any] = {"path": str(path)}
    if engine == "pybullet":
        exec("import pybullet as p; p.connect(p.DIRECT)", names)
    elif engine == "drake":
        exec("from pydrake.multibody.plant import MultibodyPlant", names)
        exec("from pydrake.multibody.parsing import Parser", names)
    else:
        exec({"pinocchio": "import pinocchio", "mujoco": "import mujoco"}[engine], names)
    if engine == "mujoco":
        # MuJoCo writes warnings to a file in the working directory unless a program handles them.
        names["mujoco"].set_mju_user_warning(lambda message: None)
    try:
        with silence():
            # Drake's call for a fixed base names the root link, which nobody knows here.
            exec(loader_class(engine).load_call(engine == "drake"), names)
    except Exception as error:
        return f"{type(error).__name__}: {error}"[:300]
    return None


def survey(
    tasks: Sequence[Task], jobs: int, seconds: float = SECONDS, results: Path | None = None
) -> list[Entry]:
    """Examine the files in worker processes; `results` keeps the entries of an interrupted run."""
    entries = read_entries(results) if results is not None and results.exists() else []
    done = {(entry["path"], base) for entry in entries for base in (entry["base"], None)}
    left = [task for task in tasks if (task.path, task.base) not in done]
    with Workers(examine, jobs, timeout=seconds) as workers:
        for count, outcome in enumerate(workers.run(left), 1):
            task = left[outcome.index]
            entry = outcome.value
            if outcome.failure is not None:
                message = outcome.failure.message
                entry = {"path": task.path, "base": task.base, "failed": outcome.failure.kind}
                entry |= {"message": message, "seconds": seconds}
            elif entry["error"]:
                entry["loads"] = _loads(task)
            entries.append(entry)
            if results is not None:
                with results.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(entry) + "\n")
            if count % 50 == 0 or count == len(left):
                print(f"{count} of {len(left)}", flush=True)
    wanted = {(task.path, task.base) for task in tasks}
    return [entry for entry in entries if {(entry["path"], base) for base in (entry["base"], None)} & wanted]


def _loads(task: Task) -> dict[str, str | None]:
    """Message of each engine that refuses the file, None for an engine that loads it."""
    loadings = [Loading(task.path, engine) for engine in task.engines or installed_engines()]
    found = {}
    with Workers(load_alone, 1, timeout=LOADING_SECONDS) as workers:
        for outcome in workers.run(loadings):
            failure = outcome.failure
            message = outcome.value if failure is None else f"{failure.kind}: {failure.message}"
            found[loadings[outcome.index].engine] = message
    return found


def read_entries(path: Path) -> list[Entry]:
    """Read the entries of earlier runs; a line cut off by the end of a run is left out."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    return [json.loads(line) for line in lines if line.endswith("\n")]


def differs(entry: Entry, above: float | None = None) -> bool:
    """Check whether any engine differs from the file above the tolerance, refuses it or is not used on it."""
    limit = entry["tolerance"] if above is None else above
    return any(
        engine["refused"]
        or engine["not_used"]
        or any(error is None or error > limit for error in engine["before"].values())
        for engine in entry["engines"]
    )


def counts(entries: Sequence[Entry]) -> str:
    """Summarise as in ``69 files: 1 refused, 46 differ, 0 with an unexplained difference``."""
    failed = sum("failed" in entry for entry in entries)
    of = [entry for entry in entries if "failed" not in entry]
    refused = sum(entry["error"] is not None for entry in of)
    different = sum(differs(entry) for entry in of)
    large = sum(differs(entry, SMALL) for entry in of)
    left = sum(bool(entry["unexplained"]) for entry in of)
    text = (
        f"{len(entries)} files: {refused} refused, {different} differ ({large} by more than {SMALL:g}), "
        f"{left} with an unexplained difference"
    )
    return text + (f", {failed} not done" if failed else "")


def remarks(entry: Entry) -> Iterator[str]:
    """Yield the remaining differences and errors of one file."""
    if "failed" in entry:
        yield f"not done: {entry['failed']}: {entry['message']}"
        return
    if entry["error"]:
        loading = [engine for engine, message in entry.get("loads", {}).items() if message is None]
        by = f" (loaded by {', '.join(loading)})" if loading else ""
        yield f"refused{by}: {entry['error']['message']}"
    for each in entry["unexplained"]:
        yield f"unexplained: {each['engine']} {each['quantity']} {each['relative_error']}"
    for rule in sorted({f["rule"] for f in entry["findings"] if f["effect"] and not f["proved"]}):
        yield f"unproved: {rule}"
    for each in entry["engines"]:
        if each["refused_after"]:
            yield f"{each['engine']} does not load it: {each['refused_after']}"
        elif each["not_used_after"]:
            yield f"{each['engine']} is not used: {each['not_used_after']}"


def summary(entries: Sequence[Entry], root: Path) -> Iterator[str]:
    """Yield the counts by base, remarks on each file, the causes and the slowest files."""
    for base in sorted({entry["base"] for entry in entries}):
        of = [entry for entry in entries if entry["base"] == base]
        sources = {_label(entry, root).partition("/")[0] for entry in of}
        yield f"{base} base: {counts(of)}; {len(sources)} sources"
        refused = [entry for entry in of if entry.get("error")]
        loading = Counter(sum(message is None for message in entry["loads"].values()) for entry in refused)
        for engines, files in sorted(loading.items()):
            yield f"  refused by dynx and loaded by {engines} engines: {files}"
        causes: Counter[str] = Counter()
        for entry in of:
            causes.update({each["rule"] for each in entry.get("findings", ()) if each["effect"]})
        yield "  files by cause: " + ", ".join(f"{rule} {number}" for rule, number in causes.most_common())
        for entry in sorted(of, key=lambda entry: -entry["seconds"])[:5]:
            yield f"  {entry['seconds']:.0f} s: {_label(entry, root)}"
        for entry in of:
            for line in remarks(entry):
                yield f"  {_label(entry, root)}: {line.replace(entry['path'], _label(entry, root))}"


def _label(entry: Entry, root: Path) -> str:
    return os.path.relpath(entry["path"], root)


def listed(source: Path) -> list[str]:
    """Paths of the URDF files below a folder, or of those that a text file lists."""
    if source.is_dir():
        return sorted(map(str, source.rglob("*.urdf")))
    return [line for line in source.read_text(encoding="utf-8").splitlines() if line.strip()]


def make_tasks(
    paths: Iterable[str],
    bases: Iterable[Base],
    engines: str | None,
    mended: str | None,
    fix_tolerance: float | None = None,
) -> list[Task]:
    """Make the tasks of all files on all bases, and the folder of corrected files."""
    if mended:
        Path(mended).mkdir(parents=True, exist_ok=True)
    chosen = tuple(engines.split(",")) if engines else None
    return [
        Task(path, base, chosen, mended, fix_tolerance)
        for path in paths
        for base in (bases if format_of_file(path) == "urdf" else [None])
    ]


def format_of_file(path: str) -> Format:
    """Return the format of a file by the tag of its root; URDF where there is none."""
    try:
        return format_of_root(XmlSource(Path(path).read_bytes(), path).root.tag)
    except DynxError:
        return "urdf"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that surveys have in common."""
    parser.add_argument("--engines", help="engines that take part, comma-separated")
    parser.add_argument("--jobs", type=int, default=2, help="number of worker processes")
    parser.add_argument("--mended", help="folder for the corrected files")
    parser.add_argument("--json", type=Path, help="file of JSON lines for the results")
    parser.add_argument("--seconds", type=float, default=SECONDS, help="time limit of one file [s]")


def main() -> None:
    """Examine the files and print the summary."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("source", type=Path, help="folder, or text file with one path per line")
    parser.add_argument("--base", choices=["fixed", "floating", "both"], default="both")
    parser.add_argument(
        "--fix-tolerance",
        type=float,
        default=FIX_TOLERANCE,
        help="largest effect that a corrected file keeps (default: that of `dynx doctor --fix`)",
    )
    add_options(parser)
    options = parser.parse_args()
    bases: list[Base] = ["fixed", "floating"] if options.base == "both" else [options.base]
    paths = listed(options.source)
    tasks = make_tasks(
        paths, bases, options.engines, options.mended, options.fix_tolerance if options.mended else None
    )
    entries = survey(tasks, options.jobs, options.seconds, options.json)
    root = Path(os.path.commonpath(paths)) if len(paths) > 1 else Path(paths[0]).parent
    for line in summary(entries, root):
        print(line)


if __name__ == "__main__":
    # By its own name, so that worker processes find what they are to run.
    from benchmarks.surveys.files import main as run

    run()
