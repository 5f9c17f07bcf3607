"""Survey of robots that public repositories describe in more than one format: are the files one robot?

    python -m benchmarks.surveys.robot_pairs list SNAPSHOTS FOLDER > benchmarks/surveys/robot_pairs.tsv
    python -m benchmarks.surveys.robot_pairs run SNAPSHOTS FOLDER --json RESULTS.jsonl [--part develop]
    python -m benchmarks.surveys.robot_pairs summary RESULTS.jsonl
    python -m docs.pairs RESULTS.jsonl

SNAPSHOTS holds a Git directory ``OWNER+NAME/repo`` of each of `REPOSITORIES`; FOLDER is for their files.
``list`` reads each file by dynx, and gives each MJCF and SDF file the URDF file whose robot it describes: one
that shares a word of its path and half of the names of its joints, of the same repository if that has one.
Files of example-robot-data count as those of a repository. Each pair is for development or for
measurement, by the SHA-256 of its names. ``run`` checks SHA-256 and compares each pair with `TOLERANCE`.
Then engines that know nothing of dynx judge the report: Pinocchio loads the URDF file, MuJoCo or Drake the
other one, and joint-space inertias (without those of a floating base, whose frame is free) are compared.

- *missed*: the engines differ, and the report says "the same robot", or mending all elements leaves a
  difference.
- *unreal*: an element is named, and putting it back alone into the mended robot changes no joint-space
  inertia and no total mass in Pinocchio.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

import dynx
from benchmarks.surveys.format_files import is_odd
from benchmarks.surveys.public_list import sha256_of, snapshot_output
from benchmarks.surveys.robot_truth import cleaned
from dynx.engines.silence import silence
from dynx.errors import DynxError
from dynx.model.document_format import format_of_root
from dynx.model.library import robots
from dynx.same import SameReport, same_robot
from dynx.workers import Workers

TABLE = Path(__file__).parent / "robot_pairs.tsv"

TOLERANCE = 1e-4
"""Tolerance of the comparison: many files hold four or five digits."""

SEEN = 1e-7
"""Relative difference of engines above which they differ; MuJoCo holds what follows from meshes in floats."""

STATES = 4

LIBRARY = "example-robot-data"

REPOSITORIES = (
    "BoosterRobotics/booster_gym",
    "RobotLocomotion/models",
    "TheRobotStudio/SO-ARM100",
    "google-deepmind/dm_control",
    "google-deepmind/mujoco",
    "hshi74/toddlerbot",
    "janhq/robotics-models",
    "kevinzakka/mink",
    "limxdynamics/robot-description",
    "mujocolab/mjlab",
    "robfiras/loco-mujoco",
    "roboterax/humanoid-gym",
    "steadymingha/mujoco_menagerie",
    "unitreerobotics/unitree_mujoco",
    "unitreerobotics/unitree_rl_gym",
    "unitreerobotics/unitree_ros",
)

ENDS = (".urdf", ".xml", ".sdf", ".mjcf")
BESIDE = (*ENDS, ".stl", ".obj", ".msh", ".dae", ".png", ".config")

COMMON_WORDS = frozenset(
    word
    for line in (
        "robot robots urdf mjcf xml sdf description descriptions model models assets resources src main base",
        "simulation gym examples example arm hand mujoco menagerie data meshes drake with and dof new rev",
        "environments scene unitree universal franka emika left right",
    )
    for word in line.split()
)
"""Words of paths that do not name a robot."""

MAX_FILES_PER_ROBOT = 2
"""Largest number of files of one format in one repository that are compared with one URDF file."""


@dataclass(frozen=True)
class RobotFile:
    """A file of a repository, the names of its moving joints, and the words of its path."""

    repository: str
    commit: str
    path: str
    digest: str
    format: str
    joints: frozenset[str]
    words: frozenset[str]


@dataclass(frozen=True)
class Pair:
    """A row of the list: a URDF file, and a file of another format."""

    part: str
    repository: str
    commit: str
    path: str
    digest: str
    other_repository: str
    other_commit: str
    other_path: str
    other_digest: str


@dataclass(frozen=True)
class PairResult:
    """Verdicts of dynx and of the engines on a pair. `largest` is the largest size of a difference."""

    pair: Pair
    word: str
    """``same``, ``different``, or ``refused``."""
    verdict: str = ""
    differences: int = 0
    unmatched: int = 0
    largest: float = 0.0
    largest_name: str = ""
    apart: str = ""
    seconds: float = 0.0
    engines: float | None = None
    """Relative difference that engines see; None where they cannot say."""
    mended: float | None = None
    """Relative difference that engines see between the first robot and the mended second one."""
    reinserted: int = 0
    """Number of elements that were reinserted alone."""
    unreal: tuple[str, ...] = ()
    """Those of them without effect."""
    note: str = ""


# The list.


def commit_of(snapshot: Path) -> str:
    """Return the commit of a snapshot."""
    return snapshot_output(snapshot, "rev-parse", "HEAD").decode().strip()


def extract(snapshots: Path, folder: Path, repository: str) -> Iterator[tuple[str, str, Path]]:
    """Write the files of a repository; yield commit, path and place of its descriptions."""
    if repository == LIBRARY:
        for entry in robots():
            if entry.source == LIBRARY:
                yield "", entry.name, Path(entry.path)
        return
    snapshot, root = snapshots / repository.replace("/", "+") / "repo", folder / repository.replace("/", "+")
    commit = commit_of(snapshot)
    listed = snapshot_output(snapshot, "ls-tree", "-r", "-z", "--name-only", commit)
    names = [name for name in listed.decode(errors="replace").split("\0") if name]
    if not root.exists():
        root.mkdir(parents=True)
        kept = [name for name in names if name.lower().endswith(BESIDE)]
        for name in kept:
            try:
                data = snapshot_output(snapshot, "cat-file", "blob", f"{commit}:{name}")
            except Exception:  # too large for the snapshot
                continue
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(data)
        # The folder of one repository, in which a file may name others.
        (root / ".git").mkdir(exist_ok=True)
    for name in sorted(names):
        if name.lower().endswith(ENDS) and (root / name).exists():
            yield commit, name, root / name


def _words(path: str) -> frozenset[str]:
    parts = Path(path).with_suffix("").parts[-3:]
    words = (word for part in parts for word in re.findall(r"[a-z]+\d*[a-z]*|\d+", part.lower()))
    return frozenset(word for word in words if len(word) > 1 and word not in COMMON_WORDS)


def _plain(name: str, model: str) -> str:
    """Return the name of a joint in lower case, without what files add to it."""
    plain = re.sub(r"joint|actuator|[^a-z0-9]", "", name.lower())
    return plain.removeprefix(re.sub(r"[^a-z0-9]", "", model.lower())) or plain


def describe(task: tuple[str, str, str, str]) -> RobotFile | None:
    """Read a file; None for one that is no robot that dynx reads."""
    repository, commit, path, place = task
    text = Path(place).read_text(encoding="utf-8", errors="replace")
    root = re.search(r"<(robot|mujoco|sdf)\b", text)
    if root is None or (repository != LIBRARY and re.search("scene|terrain|_map_", Path(path).stem)):
        return None
    try:
        model = dynx.load(Path(place))
    except DynxError:
        return None
    if len(model.joint_names) < 2:
        return None
    joints = frozenset(_plain(name, model.name) for name in model.joint_names)
    words = _words(path) | _words(model.name)
    return RobotFile(repository, commit, path, sha256_of(text), format_of_root(root[1]), joints, words)


def likeness(one: RobotFile, other: RobotFile) -> float:
    """Return how likely two files describe one robot, from 0 to 3."""
    if not one.words & other.words:
        return 0.0
    shared = len(one.joints & other.joints) / len(one.joints | other.joints)
    if shared < 0.5 and not (one.repository == other.repository and len(one.joints) == len(other.joints)):
        return 0.0
    named_alike = Path(one.path).stem.lower() == Path(other.path).stem.lower()
    return shared + len(one.words & other.words) / len(one.words | other.words) + named_alike


def choose(files: Sequence[RobotFile]) -> Iterator[Pair]:
    """Yield the pairs: the URDF file most like each other file, first of the same repository."""
    described = [each for each in files if each.format == "urdf"]
    taken: dict[tuple[RobotFile, str, str], int] = {}
    seen: set[str] = set()
    for each in files:
        if each.format == "urdf" or each.digest in seen:
            continue
        seen.add(each.digest)
        ranked = [
            (one.repository == each.repository, likeness(one, each), one.path, one)
            for one in described
            if likeness(one, each) > 0.0
        ]
        if not ranked:
            continue
        best = max(ranked, key=lambda entry: entry[:3])[3]
        key = (best, each.repository, each.format)
        taken[key] = taken.get(key, 0) + 1
        if taken[key] > MAX_FILES_PER_ROBOT:
            continue
        name = f"{best.repository}/{best.path} {each.repository}/{each.path}"
        yield Pair(
            "develop" if is_odd(name) else "bar",
            *(best.repository, best.commit, best.path, best.digest),
            *(each.repository, each.commit, each.path, each.digest),
        )


def list_pairs(snapshots: Path, folder: Path, jobs: int) -> None:
    """Print the list."""
    tasks = [
        (repository, commit, path, str(place))
        for repository in (LIBRARY, *REPOSITORIES)
        for commit, path, place in extract(snapshots, folder, repository)
    ]
    found: dict[int, RobotFile] = {}
    with Workers(describe, jobs, timeout=30.0) as workers:
        for outcome in workers.run(tasks):
            if outcome.value is not None:
                found[outcome.index] = outcome.value
    writer = csv.writer(sys.stdout, delimiter="\t", lineterminator="\n")
    writer.writerows(tuple(vars(each).values()) for each in choose([found[k] for k in sorted(found)]))


def read_pairs() -> list[Pair]:
    """Read the list."""
    with TABLE.open(encoding="utf-8", newline="") as file:
        return [Pair(*row) for row in csv.reader(file, delimiter="\t")]


# What engines say.


@dataclass(frozen=True)
class Seen:
    """Joint-space inertias of a robot in an engine at the states, and its total mass [kg], which engines
    show only where the base floats."""

    mass: float
    inertias: tuple[Any, ...]

    def difference(self, other: Seen) -> float:
        """Return the largest relative difference."""
        worst = abs(self.mass - other.mass) / max(abs(self.mass), 1e-300)
        for mine, theirs in zip(self.inertias, other.inertias, strict=True):
            d = np.sqrt(np.abs(np.diag(mine)))
            scale = np.outer(d, d)
            apart = np.abs(mine - theirs) / np.where(scale > 0.0, scale, 1.0)
            worst = max(worst, float(np.max(apart, initial=0.0)))
        return worst


def _of_joints(M: Any, base: int) -> Any:
    """Return the inertia that joints feel: that of a free base is eliminated, so that its frame is free."""
    if base == 0:
        return M
    B = M[:base, :base]
    return M[base:, base:] - M[base:, :base] @ np.linalg.solve(B, M[:base, base:])


def by_pinocchio(text: str, floating: bool, names: Sequence[str], states: Sequence[Any]) -> Seen:
    """Return what Pinocchio sees of URDF text, with the joints in the order of `names`."""
    import pinocchio

    given = ElementTree.tostring(cleaned(text), encoding="unicode")
    free = (pinocchio.JointModelFreeFlyer(),) if floating else ()
    model = pinocchio.buildModelFromXML(given, *free)
    data = model.createData()
    base = 6 if floating else 0
    joints = [model.joints[model.getJointId(name)] for name in names]
    columns = [joint.idx_v for joint in joints]
    inertias = []
    for state in states:
        q = pinocchio.neutral(model)
        for joint, value in zip(joints, state, strict=True):
            q[joint.idx_q] = value
        M = np.asarray(pinocchio.crba(model, data, q))
        M = np.triu(M) + np.triu(M, 1).T
        order = [*range(base), *columns]
        inertias.append(_of_joints(M[np.ix_(order, order)], base))
    mass = float(sum(inertia.mass for inertia in model.inertias))
    return Seen(mass if floating else 1.0, tuple(inertias))


def without_shapes(text: str) -> str:
    """Return MJCF without shapes and all that refers to them, if no inertia follows from them."""
    root = ElementTree.fromstring(text.encode())
    moving = ("joint", "freejoint")
    bodies = [body for body in root.iter("body") if any(child.tag in moving for child in body)]
    written = all(body.find("inertial") is not None for body in bodies)
    derived = any(each.get("inertiafromgeom") == "true" for each in root.iter("compiler"))
    if not written or derived or root.find(".//include") is not None:
        return text
    dropped = ("geom", "asset", "contact", "sensor", "actuator", "keyframe", "equality", "tendon", "visual")
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in dropped and parent.tag != "default":
                parent.remove(child)
    return ElementTree.tostring(root, encoding="unicode")


def by_mujoco(text: str, folder: Path, names: Sequence[str], states: Sequence[Any]) -> Seen:
    """Return what MuJoCo sees of the text of an MJCF file in a folder, without armature."""
    import mujoco

    with tempfile.NamedTemporaryFile("w", suffix=".xml", dir=folder, encoding="utf-8") as file:
        file.write(without_shapes(text))
        file.flush()
        with silence():
            model = mujoco.MjModel.from_xml_path(file.name)
    model.dof_armature[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    free = [j for j in range(model.njnt) if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_FREE]
    base = [int(model.jnt_dofadr[j]) + k for j in free[:1] for k in range(6)]
    joints = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, name) for name in names]
    if min(joints, default=0) < 0:
        raise ValueError("MuJoCo has other names of joints")
    inertias = []
    for state in states:
        mujoco.mj_resetData(model, data)
        for joint, value in zip(joints, state, strict=True):
            data.qpos[model.jnt_qposadr[joint]] = value
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M) if mujoco.__version__ >= "3.4" else mujoco.mj_fullM(model, M, data.qM)
        order = [*base, *(int(model.jnt_dofadr[joint]) for joint in joints)]
        inertias.append(_of_joints(M[np.ix_(order, order)], len(base)))
    return Seen(float(np.sum(model.body_mass[1:])) if free else 1.0, tuple(inertias))


def by_drake(text: str, floating: bool, names: Sequence[str], states: Sequence[Any]) -> Seen:
    """Return what Drake sees of SDF text."""
    import pydrake.multibody.parsing as parsing
    import pydrake.multibody.plant as plants

    plant: Any = plants.MultibodyPlant(0.0)
    parser: Any = parsing.Parser(plant)
    parser.AddModelsFromString(ElementTree.tostring(cleaned(text), encoding="unicode"), "sdf")
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name) for name in names]
    base = list(range(6)) if floating else []
    inertias = []
    for state in states:
        q = plant.GetPositions(context).copy()
        for joint, value in zip(joints, state, strict=True):
            q[joint.position_start()] = value
        plant.SetPositions(context, q)
        order = [*base, *(joint.velocity_start() for joint in joints)]
        inertias.append(_of_joints(plant.CalcMassMatrix(context)[np.ix_(order, order)], len(base)))
    return Seen(float(plant.CalcTotalMass(context)) if floating else 1.0, tuple(inertias))


def reason(error: Exception) -> str:
    """Return the first line of an error's message."""
    return f"{type(error).__name__} {error}".splitlines()[0][:120]


def judged(result: PairResult, report: SameReport, text: str, other: str) -> PairResult:
    """Return the result with what engines say."""
    floating = report.T_first_second is not None
    rows = report.coordinates
    if not rows:
        return replace(result, note=f"{result.note}; not judged: no joint has a counterpart")
    rng = np.random.default_rng(0)
    states = [rng.uniform(-0.5, 0.5, len(rows)) for _ in range(STATES)]
    signs = np.array([row.sign for row in rows])
    theirs = [signs * state for state in states]
    first = by_pinocchio(text, floating, [row.ours for row in rows], states)

    def of_second(seen: Seen) -> Seen:
        return Seen(seen.mass, tuple(np.outer(signs, signs) * M for M in seen.inertias))

    names = [row.theirs for row in rows]
    place = Path(other)
    given = place.read_text(encoding="utf-8")
    is_mjcf = re.search(r"<mujoco\b", given) is not None

    def second(described: str) -> Seen:
        if is_mjcf:
            return of_second(by_mujoco(described, place.parent, names, theirs))
        return of_second(by_drake(described, floating, names, theirs))

    note = ""
    try:
        result = replace(result, engines=first.difference(second(given)))
    except Exception as error:  # an engine that refuses a file cannot judge
        note = f"not judged: {reason(error)}"
    if not (report.unmatched or report.same):
        assert report.mended is not None
        if report.mended_text is not None and not note:
            mended = second(report.mended_text.decode())
        else:
            mended = of_second(by_pinocchio(report.mended.to_urdf(), floating, names, theirs))
        result = replace(result, mended=first.difference(mended))
        effects = dict(_effects(report, floating, names, theirs))
        unreal = tuple(name for name, size in effects.items() if size <= SEEN)
        result = replace(result, reinserted=len(effects), unreal=unreal)
    return replace(result, note="; ".join(filter(None, (result.note, note))))


def _effects(
    report: SameReport, floating: bool, names: Sequence[str], states: Sequence[Any]
) -> Iterator[tuple[str, float]]:
    """Yield the elements, and how much Pinocchio's values change if they alone are as they were."""
    assert report.mended is not None
    mended = report.mended
    right = by_pinocchio(mended.to_urdf(), floating, names, states)
    second = dynx.load(report.second_source, base=mended.base)
    for each in report.differences:
        if each.part in ("type", "mimic"):
            continue
        if each.tag == "joint":
            was = getattr(second.joint(each.theirs), each.part)
            joints = tuple(
                replace(joint, **{each.part: was}) if joint.name == each.theirs else joint
                for joint in mended.joints
            )
            variant = replace(mended, joints=joints)
        else:
            old = second.link(each.theirs).inertial
            links = tuple(
                replace(link, inertial=old) if link.name == each.theirs else link for link in mended.links
            )
            variant = replace(mended, links=links)
        changed = by_pinocchio(variant.to_urdf(), floating, names, states)
        yield f"{each.tag} {each.theirs}, {each.part}", right.difference(changed)


def compare(task: tuple[Pair, str, str]) -> PairResult:
    """Compare the files of a pair."""
    pair, first, second = task
    try:
        report = same_robot(Path(first), Path(second), tolerance=TOLERANCE)
    except DynxError as error:
        return PairResult(pair, "refused", str(error))
    kinds: dict[str, int] = {}
    for attribute in report.attributes:
        kinds[attribute.kind] = kinds.get(attribute.kind, 0) + 1
    largest = max(report.differences, key=lambda each: each.size, default=None)
    result = PairResult(
        pair,
        "same" if report.same else "different",
        report.verdict,
        len(report.differences),
        len(report.unmatched),
        0.0 if largest is None else largest.size,
        "" if largest is None else f"{largest.tag} {largest.theirs}, {largest.part}: {largest.message}",
        ", ".join(f"{kind} ({count})" for kind, count in kinds.items()),
        report.seconds,
        note="; ".join(each.message for each in report.unmatched[:3]),
    )
    try:
        return judged(result, report, Path(first).read_text(encoding="utf-8"), second)
    except Exception as error:  # an engine that refuses a file cannot judge
        return replace(result, note=f"{result.note}; not judged: {reason(error)}")


def run_pairs(snapshots: Path, folder: Path, part: str | None, jobs: int, results: Path) -> None:
    """Compare the pairs of the list, or of one part, and write the results."""
    places = {
        (repository, path): place
        for repository in (LIBRARY, *REPOSITORIES)
        for _, path, place in extract(snapshots, folder, repository)
    }
    tasks: list[tuple[Pair, str, str]] = []
    for pair in read_pairs():
        if part not in (None, pair.part):
            continue
        files = places[pair.repository, pair.path], places[pair.other_repository, pair.other_path]
        for place, digest in zip(files, (pair.digest, pair.other_digest), strict=True):
            if sha256_of(place.read_text(encoding="utf-8", errors="replace")) != digest:
                raise ValueError(f"{place} is not the file of the list")
        tasks.append((pair, str(files[0]), str(files[1])))
    with Workers(compare, jobs, timeout=120.0) as workers, results.open("w", encoding="utf-8") as file:
        for outcome in workers.run(tasks):
            failure = outcome.failure
            pair = tasks[outcome.index][0]
            result = outcome.value if failure is None else PairResult(pair, "refused", failure.message)
            assert result is not None
            file.write(json.dumps(asdict(result)) + "\n")
            file.flush()


def read_results(path: Path) -> list[PairResult]:
    """Read results, in the order of the list."""
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    found = [
        PairResult(**{**row, "pair": Pair(**row["pair"]), "unreal": tuple(row["unreal"])}) for row in rows
    ]
    order = {pair: number for number, pair in enumerate(read_pairs())}
    return sorted(found, key=lambda each: order[each.pair])


def missed(result: PairResult) -> bool:
    """Check whether engines see a difference that the report does not name."""
    by_engines = result.engines is not None and result.engines > 10.0 * TOLERANCE
    left = result.mended is not None and result.mended > 10.0 * TOLERANCE
    return (result.word == "same" and by_engines) or left


def summary(results: Sequence[PairResult]) -> str:
    """Return the counts of a part in a sentence."""
    words = {word: sum(each.word == word for each in results) for word in ("same", "different", "refused")}
    judged_ones = [each for each in results if each.engines is not None or each.mended is not None]
    reinserted = sum(each.reinserted for each in results)
    effective = reinserted - sum(len(each.unreal) for each in results)
    return (
        f"Of {len(results)} pairs, {words['same']} pairs describe the same robot, and {words['different']} "
        f"pairs describe different robots. Pairs that dynx refuses: {words['refused']}. Engines checked the "
        f"reports of {len(judged_ones)} pairs. Pairs with a missed difference: {sum(map(missed, results))}. "
        f"The survey put {reinserted} elements back. {effective} of them change the robot in Pinocchio."
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=["list", "run", "summary"])
    parser.add_argument("snapshots", type=Path)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--part", choices=("develop", "bar"))
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--json", type=Path, default=Path("pairs.jsonl"))
    given = parser.parse_args(arguments)
    if given.command == "list":
        list_pairs(given.snapshots, given.folder, given.jobs)
    elif given.command == "run":
        run_pairs(given.snapshots, given.folder, given.part, given.jobs, given.json)
    else:
        results = read_results(given.snapshots)
        for part in ("develop", "bar"):
            print(f"{part}: {summary([each for each in results if each.pair.part == part])}")


if __name__ == "__main__":
    # By its own name, so that worker processes find what they are to run.
    from benchmarks.surveys.robot_pairs import main as run_survey

    run_survey()
