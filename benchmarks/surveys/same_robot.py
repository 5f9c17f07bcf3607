"""Mended files against their originals, and the printed calls in fresh processes. No dynx in here.

    python benchmarks/surveys/same_robot.py RESULTS.jsonl [--within 1e-9] [--no-calls]

RESULTS are those of ``benchmarks.surveys.files --json RESULTS --mended FOLDER``. A parser of its own reads
names, parents, types, axes, origins, limits, masses, centres of mass and tensors (in link axes) of both. A
difference is stated where a finding or a change of the report names the link or joint, or a line of it;
others are printed, as are other numbers of coordinates. Then each engine loads the mended file, without its
meshes, by the printed call and lines of code, in a process of its own.
"""

from __future__ import annotations

import argparse
import difflib
import json
import math
import re
import statistics
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.parsers import expat

import numpy as np

MOVING = {"revolute": 1, "continuous": 1, "prismatic": 1, "planar": 3, "floating": 6, "spherical": 3}
"""Coordinates of a joint by its type."""

PRELUDES = {
    "pinocchio": "import pinocchio",
    "pybullet": "import pybullet as p; p.connect(p.DIRECT)",
    "mujoco": "import mujoco",
    "drake": "from pydrake.all import MultibodyPlant, Parser",
}
"""Imports that the printed calls presuppose."""

FINALIZE = "plant.Finalize()"

CALL_SECONDS = 120.0
"""Time limit of one engine for loading one file [s]."""

_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.])")


@dataclass
class Node:
    """An element with the lines on which it begins and ends."""

    tag: str
    attributes: dict[str, str]
    line: int
    last_line: int = 0
    text: str = ""
    children: list[Node] = field(default_factory=list)

    def first(self, tag: str) -> Node | None:
        return next((child for child in self.children if child.tag == tag), None)

    def get(self, tag: str, name: str, default: str = "") -> str:
        child = self.first(tag)
        return default if child is None else child.attributes.get(name, default)

    def without_meshes(self) -> str:
        """Write the element again, without shapes that are meshes and without textures."""
        inside = _escaped(self.text.strip()) + "".join(
            child.without_meshes() for child in self.children if not child.names_file()
        )
        words = "".join(f' {name}="{_escaped(value)}"' for name, value in self.attributes.items())
        return f"<{self.tag}{words}>{inside}</{self.tag}>\n"  # PyBullet cannot read lines that are long.

    def names_file(self) -> bool:
        if self.tag == "texture":
            return True
        shape = self.tag in ("visual", "collision")
        return shape and any(child.tag == "mesh" for each in self.children for child in each.children)


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")


def parse(data: bytes) -> Node:
    """Parse a document."""
    parser = expat.ParserCreate()
    top = Node("", {}, 0)
    stack = [top]

    def begin(tag: str, attributes: dict[str, str]) -> None:
        node = Node(tag, dict(attributes), parser.CurrentLineNumber)
        stack[-1].children.append(node)
        stack.append(node)

    def end(tag: str) -> None:
        stack.pop().last_line = parser.CurrentLineNumber

    def read(text: str) -> None:
        stack[-1].text += text

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = read
    parser.Parse(data, True)
    return top.children[0]


def vector(text: str, default: tuple[float, ...]) -> np.ndarray:
    words = text.split()
    return np.array([float(word) for word in words] if len(words) == len(default) else default)


def rotation(rpy: np.ndarray) -> np.ndarray:
    (cx, cy, cz), (sx, sy, sz) = np.cos(rpy), np.sin(rpy)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def number(text: str, default: float = 0.0) -> float:
    try:
        return float(text)
    except ValueError:
        return default


Reading = dict[tuple[str, str], dict[str, Any]]


def reading(robot: Node) -> Reading:
    """Return what the document states of each link and joint, by tag and name."""
    found: Reading = {}
    for node in robot.children:
        key = node.tag, node.attributes.get("name", "")
        if key in found:
            continue
        if node.tag == "link":
            found[key] = _body(node.first("inertial"))
        elif node.tag == "joint":
            found[key] = _joint(node)
    return found


def _body(inertial: Node | None) -> dict[str, Any]:
    if inertial is None:
        return {"mass": 0.0, "center": np.zeros(3), "tensor": np.zeros((3, 3))}
    R = rotation(vector(inertial.get("origin", "rpy"), (0.0, 0.0, 0.0)))
    names = (("ixx", "ixy", "ixz"), ("ixy", "iyy", "iyz"), ("ixz", "iyz", "izz"))
    tensor = np.array([[number(inertial.get("inertia", name)) for name in row] for row in names])
    mass = number(inertial.get("mass", "value"))
    center = vector(inertial.get("origin", "xyz"), (0.0, 0.0, 0.0)) if mass else np.zeros(3)
    return {"mass": mass, "center": center, "tensor": R @ tensor @ R.T}


def _joint(node: Node) -> dict[str, Any]:
    kind = node.attributes.get("type", "")
    moves = kind in ("revolute", "continuous", "prismatic", "planar")
    axis = vector(node.get("axis", "xyz"), (1.0, 0.0, 0.0)) if moves else np.zeros(3)
    length = float(np.linalg.norm(axis))
    limits = [number(node.get("limit", name), math.nan) for name in ("lower", "upper", "effort", "velocity")]
    return {
        "type": kind,
        "parent": node.get("parent", "link"),
        "child": node.get("child", "link"),
        "position": vector(node.get("origin", "xyz"), (0.0, 0.0, 0.0)),
        "rotation": rotation(vector(node.get("origin", "rpy"), (0.0, 0.0, 0.0))),
        "axis": axis / length if length else axis,
        "limits": np.array(limits if moves and node.first("limit") else [math.nan] * 4),
        "mimic": node.get("mimic", "joint"),
        "damping": number(node.get("dynamics", "damping")),
        "friction": number(node.get("dynamics", "friction")),
    }


def coordinates(robot: Node, base: str) -> int:
    """Number of velocities; the names of joints count once."""
    types = {
        node.attributes.get("name", ""): node.attributes.get("type", "")
        for node in robot.children
        if node.tag == "joint" and node.first("mimic") is None
    }
    return sum(MOVING.get(kind, 0) for kind in types.values()) + 6 * (base == "floating")


def differences(one: Reading, other: Reading, within: float) -> Iterator[tuple[tuple[str, str], str]]:
    """Yield the part and the property of each difference; numbers relative to the largest of their kind.

    Masses, centres and tensors are compared with those of the whole robot, since what is smaller changes no
    equation of motion.
    """
    bodies = [body for (tag, _), body in one.items() if tag == "link"]
    sizes = {
        name: max((float(np.max(np.abs(body[name]), initial=0.0)) for body in bodies), default=0.0)
        for name in ("mass", "center", "tensor")
    }
    for key in one.keys() | other.keys():
        if key not in one or key not in other:
            yield key, "added" if key not in one else "removed"
            continue
        for name, before in one[key].items():
            after = other[key][name]
            if isinstance(before, str):
                alike = before == after
            else:
                size = sizes.get(name) or max(1.0, float(np.nanmax(np.abs(before), initial=0.0)))
                alike = np.allclose(before, after, rtol=0.0, atol=within * size, equal_nan=True)
            if not alike:
                yield key, name


def stated(entry: dict[str, Any], robot: Node, key: tuple[str, str]) -> bool:
    """Check whether a finding or a change of the report names the part, or a line of it."""
    tag, name = key
    nodes = [node for node in robot.children if node.tag == tag and node.attributes.get("name", "") == name]
    lines = {line for node in nodes for line in range(node.line, node.last_line + 1)}
    found = any(each[tag] == name or each["line"] in lines for each in entry["findings"])
    return found or any(name in each[f"{tag}s"] for each in entry["changes"])


def changed_lines(before: str, after: str) -> tuple[int, list[int]]:
    """Return the number of changed lines, and the significant digits of each new number that is not zero."""
    removed, added = [], []
    for line in difflib.ndiff(before.splitlines(), after.splitlines()):
        if line.startswith("- "):
            removed.append(line[2:])
        elif line.startswith("+ "):
            added.append(line[2:])
    old = Counter(word for line in removed for word in _NUMBER.findall(line))
    new = Counter(word for line in added for word in _NUMBER.findall(line)) - old
    digits = (len(re.sub(r"[eE].*|\D", "", word).strip("0")) for word in new.elements())
    return max(len(removed), len(added)), [count for count in digits if count]


def call_errors(entry: dict[str, Any], mended: Node, folder: Path) -> dict[str, str]:
    """Load a mended file by the printed calls; return the end of the error of each engine that fails."""
    path = folder / f"{Path(entry['mended']).stem}.urdf"
    path.write_text(mended.without_meshes(), encoding="utf-8")
    children = {node.get("child", "link") for node in mended.children if node.tag == "joint"}
    links = [node.attributes.get("name", "") for node in mended.children if node.tag == "link"]
    root = next((name for name in links if name not in children), "")
    found = {}
    for engine in entry["engines"]:
        if engine["refused_after"] or engine["not_used_after"]:
            continue
        name, load = engine["engine"], engine["call"]
        codes = [each["code"] for each in entry["calls"] if each["engine"] == name]
        # The comments in the lines for Drake say where they stand.
        code = "\n".join(codes)
        lines = load.replace(FINALIZE, f"{code}\n{FINALIZE}") if name == "drake" else f"{load}\n{code}"
        script = f"path, root_link = {str(path)!r}, {root!r}\n{PRELUDES[name]}\n{lines}\n"
        try:
            done = subprocess.run(
                [sys.executable, "-c", script],
                check=False,
                capture_output=True,
                text=True,
                cwd=folder,
                timeout=CALL_SECONDS,
            )
        except subprocess.TimeoutExpired:
            found[name] = "no end"
            continue
        if done.returncode:
            found[name] = f"exit code {done.returncode}: {done.stderr.strip()[-200:]}"
    return found


def main() -> None:
    """Compare, call and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("--within", type=float, default=1e-9, help="largest relative difference of numbers")
    parser.add_argument("--no-calls", action="store_true", help="do not load the mended files")
    options = parser.parse_args()
    entries = [json.loads(line) for line in options.results.read_text(encoding="utf-8").splitlines()]
    counts: Counter[str] = Counter()
    exceptions: Counter[str] = Counter()
    lines, digits, calls = [], [], []
    for entry in entries:
        label = f"{entry['path']}, {entry['base']}"
        if "mended" not in entry:
            counts["without a mended file"] += 1
            print(f"{label}: {entry.get('message') or (entry['error'] or {}).get('message')}")
            continue
        before_data, after_data = Path(entry["path"]).read_bytes(), Path(entry["mended"]).read_bytes()
        try:
            before, after = parse(before_data), parse(after_data)
        except expat.ExpatError as error:
            counts["not parsed"] += 1
            print(f"{label}: not parsed: {error}")
            continue
        counts["compared"] += 1
        counts["withheld"] += bool(entry["withheld"])
        nv = coordinates(before, entry["base"]), coordinates(after, entry["base"])
        found = list(differences(reading(before), reading(after), options.within))
        unstated = [(key, name) for key, name in found if not stated(entry, before, key)]
        exceptions.update(name for key, name in found if (key, name) not in unstated)
        counts["another number of coordinates"] += nv[0] != nv[1]
        counts["another reading"] += bool(unstated)
        counts["another reading that the report states"] += bool(found) and not unstated
        if nv[0] != nv[1]:
            print(f"{label}: {nv[1]} coordinates instead of {nv[0]}")
        for (tag, name), what in unstated:
            print(f"{label}: {what} of {tag} {name}")
        texts = [data.decode(errors="replace") for data in (before_data, after_data)]
        if texts[0] != texts[1]:
            changed, new = changed_lines(*texts)
            lines.append(changed)
            digits += new
        calls.append((label, entry, after))
    print(", ".join(f"{name} {count}" for name, count in counts.items()))
    print("stated differences by property:", dict(exceptions.most_common()))
    if lines:
        print(f"{len(lines)} files changed; median of changed lines {statistics.median(lines):g}")
    if digits:
        print(
            f"{len(digits)} new numbers; median of digits {statistics.median(digits):g}, most {max(digits)}"
        )
    if not options.no_calls:
        with TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
            errors = list(pool.map(lambda each: call_errors(each[1], each[2], Path(folder)), calls))
        for (label, _, _), failed in zip(calls, errors, strict=True):
            for engine, message in failed.items():
                print(f"{label}: {engine}: {message}")
        done = sum(not (e["refused_after"] or e["not_used_after"]) for _, x, _ in calls for e in x["engines"])
        print(f"printed calls: {done - sum(map(len, errors))} of {done} run in processes of their own")


if __name__ == "__main__":
    main()
