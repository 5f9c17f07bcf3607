"""Examination of one file in several engines: their quantities, and the errors against reference values."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import count, product
from pathlib import Path

import numpy as np

from dynx.agreement.referee import Referee
from dynx.agreement.tolerances import BAR
from dynx.backends.solvability import singular_coordinates
from dynx.engines.silence import silence
from dynx.errors import DescriptionError, DynxError, UnusableEngineError
from dynx.files.lines import line_opcodes, lines_of
from dynx.files.temporary import temporary_folder
from dynx.loaded import LoadedModel, LoadedRobot, loader_class
from dynx.model import Model
from dynx.model.document_format import SUFFIXES, Format, format_of_root
from dynx.model.elements import Vector
from dynx.model.geometry.formats.facets import STL_FACET
from dynx.model.loading import read_model
from dynx.model.tree import Base
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.rules import Detection, Rule
from dynx.rules.case import Case
from dynx.rules.geometry import (
    bullet_box,
    collision_meshes,
    file_of_mesh,
    has_shape,
    is_found,
    links_in,
    may_be_refused,
    texture_replacements,
)
from dynx.rules.inertia import has_inertial_data
from dynx.rules.joints import fresh_name
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_exp, quat_log
from dynx.workers import Workers

# Collision meshes for PyBullet's plain call, each replaced by the eight corners of its bounding box.
#
# Without ``URDF_USE_INERTIA_FROM_FILE`` PyBullet computes inertias from the bounding boxes of shapes in
# their own frames, so the corners give the same inertia as the mesh. They load faster, and PyBullet never
# sees the file that a description names: its readers end the process on damaged files, and open any path.
#
# PyBullet adds another margin to the hull of an OBJ file than to that of STL and COLLADA files, so the
# corners keep that difference. It reads no text STL, and ignores the up axis of COLLADA. A mesh that dynx
# cannot find or read is left out.


_FACES = (
    *((0, 1, 2), (1, 3, 2), (4, 6, 5), (5, 6, 7), (0, 4, 1), (1, 4, 5)),
    *((2, 3, 6), (3, 7, 6), (0, 2, 4), (2, 6, 4), (1, 5, 3), (3, 5, 7)),
)
"""Triangles of a box by the numbers of its corners."""


def with_mesh_boxes(source: XmlSource, folder: Path) -> XmlSource:
    """Replace each collision mesh by a mesh of the corners of its box, written into `folder`; those that
    cannot be found or read are removed."""
    return source.apply(*_edits(source, folder))


def _edits(source: XmlSource, folder: Path) -> Iterator[Edit]:
    written: dict[str, Path | None] = {}
    for link in source.root.all("link"):
        for collision, mesh in collision_meshes(link):
            name = mesh.attributes.get("filename", "")
            if name not in written:
                written[name] = _write_corners(folder / f"mesh{len(written)}", name, source.source)
            path = written[name]
            if path is None:
                yield source.keeping_lines(source.removal(collision))
            else:
                yield source.attribute_edit(mesh, "filename", str(path))


def _write_corners(path: Path, name: str, source: str) -> Path | None:
    """Write the corners of the box of a mesh, as OBJ for an OBJ file, else as STL; None if it is not read."""
    found = bullet_box(name, source)
    if found is None:
        return None
    (low, high), suffix = found
    corners = list(product(*zip(low, high, strict=True)))
    if suffix == ".obj":
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners]
        lines += [f"f {i + 1} {j + 1} {k + 1}" for i, j, k in _FACES]
        path = path.with_suffix(suffix)
        path.write_text("\n".join([*lines, ""]), encoding="ascii")
        return path
    facets = np.zeros(len(_FACES), STL_FACET)
    facets["corners"] = np.array(corners)[np.array(_FACES)]
    path = path.with_suffix(".stl")
    path.write_bytes(bytes(80) + len(_FACES).to_bytes(4, "little") + facets.tobytes())
    return path


# Line map from the file made readable to the user's file, in which the lines of findings are reported.


def with_original_lines(
    found: Sequence[tuple[Rule, Detection]], given: XmlSource, readable: XmlSource
) -> list[tuple[Rule, Detection]]:
    """Translate the lines of detections to the `given` text; rules about the text have these already."""
    if given.data == readable.data:
        return list(found)
    lines = line_map(*(lines_of(each.text_with_lines_before) for each in (given, readable)))
    return [
        (rule, replace(each, line=lines.get(each.line, each.line)))
        if rule.stage == "model" and each.line is not None
        else (rule, each)
        for rule, each in found
    ]


def line_map(given: Sequence[str], readable: Sequence[str]) -> dict[int, int]:
    """Map each line of the readable text to its line in the given text; a new line to where it was added."""
    lines = {}
    for _, first, last, start, end in line_opcodes(readable, given):
        for k in range(first, last):
            lines[k + 1] = min(start + k - first, max(end - 1, 0)) + 1
    return lines


_BOX = '<box size="1 1 1"/>'


def without_meshes(source: XmlSource, *, collisions: bool = True) -> XmlSource:
    """Remove visual shapes, textures that engines find and, with `collisions`, collision shapes that are
    meshes. Visuals for which an engine may refuse the file are left, with a box in place of a mesh file.

    In MJCF masses may follow from meshes, so that these documents stay as they are. In SDF they may follow
    from those of collisions, of which the missing ones are removed.
    """
    form = format_of_root(source.root.tag)
    if form != "urdf":
        edits_of_sdf = _mesh_edits_of_sdf(source) if form == "sdf" else ()
        return source.apply(*map(source.keeping_lines, edits_of_sdf))
    links = source.root.all("link")
    visuals = [shape for link in links for shape in link.all("visual") if has_shape(shape)]
    left = [shape for shape in visuals if may_be_refused(shape)]
    shapes = [shape for shape in visuals if shape not in left]
    boxes = [source.replacement(mesh, _BOX) for shape in left for mesh in _named_meshes(shape)]
    if collisions:
        shapes += [shape for link in links for shape, _ in collision_meshes(link)]
    edits = (*map(source.removal, shapes), *boxes, *texture_replacements(source))
    return source.apply(*map(source.keeping_lines, edits))


_BOX_OF_SDF = "<box><size>1 1 1</size></box>"


def _mesh_edits_of_sdf(source: XmlSource) -> Iterator[Edit]:
    """Write a box in place of each mesh of a visual; remove collisions whose mesh is not found."""
    for part in (part for link in links_in(source) for part in link.children):
        for mesh in (each for each in part.walk() if each.tag == "mesh"):
            if part.tag == "visual":
                yield source.replacement(mesh, _BOX_OF_SDF)
            elif part.tag == "collision" and not is_found(file_of_mesh(source, mesh), source.source):
                yield source.removal(part)
                break


def _named_meshes(shape: SourceElement) -> list[SourceElement]:
    """Return the meshes of a shape that name a file."""
    return [each for each in shape.walk() if each.tag == "mesh" and each.attributes.get("filename")]


_FOLDERS_ABOVE = 4
"""Largest number of folders above a document in MJCF or SDF in which it may name files, as in
``../meshes/arm.stl``."""

_ABOVE = re.compile(r"(?:\.\./)+")

_URI_OF_FILE = re.compile(r"(?<!http)(?<!https)://")
"""Part of a URI of a file, unlike the address of a web page in a comment or of a namespace."""


@contextmanager
def temporary_document(
    source: XmlSource, *, mesh_boxes: bool = False, folders: DocumentFolders | None = None
) -> Iterator[Path]:
    """Write the document, with `mesh_boxes` in place of collision meshes, to a file that exists while the
    context lasts.

    A document in MJCF or SDF includes files and names meshes by their place relative to its own. Links to
    these stand beside the file. `folders` keeps the links for the next document from the same place.
    """
    form = format_of_root(source.root.tag)
    with ExitStack() as stack:
        if form == "urdf" or folders is None:
            folder = stack.enter_context(temporary_folder())
            if form != "urdf":
                folder = _linked_folder(folder, Path(source.source), _folders_above(source.text))
        else:
            folder = folders.of(source)
        path = _unused_path(folder, SUFFIXES[form][0], Path(source.source).name)
        path.unlink(missing_ok=True)
        written = with_mesh_boxes(source, folder) if mesh_boxes else source
        path.write_bytes(written.to_bytes())
        try:
            yield path
        finally:
            path.unlink(missing_ok=True)


class DocumentFolders:
    """Temporary folders with links to the files around a document, kept until `close`.

    Links to hundreds of files take longer than most engines. An engine that keeps meshes by their paths, as
    MuJoCo does, reads each of them once.
    """

    def __init__(self) -> None:
        self._kept = ExitStack()
        self._made: dict[tuple[str, int], Path] = {}

    def of(self, source: XmlSource) -> Path:
        """Return the folder for a document, which stands for its own folder."""
        place = source.source, _folders_above(source.text)
        if place not in self._made:
            folder = self._kept.enter_context(temporary_folder())
            self._made[place] = _linked_folder(folder, Path(source.source), place[1])
        return self._made[place]

    def close(self) -> None:
        """Remove the folders."""
        self._made.clear()
        self._kept.close()


def _unused_path(folder: Path, suffix: str, document: str) -> Path:
    """Return the path ``robot`` with a suffix; with a number where a file other than the document, which it
    may include, has this name."""
    taken = {each.stem for each in folder.glob(f"robot*{suffix}") if each.name != document}
    return folder / f"{fresh_name('robot', taken)}{suffix}"


def _folders_above(text: str) -> int:
    """Return the number of folders above a document in which it names files; of its includes and of URIs,
    such as ``model://arm/arm.stl``, it is not known.
    """
    if "<include" in text or _URI_OF_FILE.search(text):
        return _FOLDERS_ABOVE
    return min(max((len(each) // 3 for each in _ABOVE.findall(text)), default=0), _FOLDERS_ABOVE)


def _linked_folder(folder: Path, document: Path, levels: int) -> Path:
    """Make folders below `folder` as those of a document and `levels` above, each with links to what is in
    it; return the innermost. There are no links where the document is no file."""
    if not document.is_file():
        return folder
    above = list(document.resolve().parents)[: levels + 1]
    made = folder
    for k in range(len(above) - 1, -1, -1):
        below = above[k - 1].name if k else None
        for entry in above[k].iterdir():
            if entry.name != below:
                (made / entry.name).symlink_to(entry)
        if below is not None:
            made = made / below
            made.mkdir()
    return made


STATES = 500
"""Number of states at which contacts are looked for, without dynamics: 5 to 15 ms of most robots."""

_MAX_PAIRS = 3
"""Number of pairs that are listed."""


@dataclass
class LinkContact:
    """Number of states in which two links touch, how deep they penetrate each other at most [m], and the
    positions of the joints where they do."""

    states: int = 0
    depth: float = 0.0
    positions: Mapping[str, float] = field(default_factory=dict)


def describe_contacts(case: Case, engine: str, seed: int, names: Mapping[str, str] | None = None) -> str:
    """Write which links touch in an engine; empty where the engine cannot tell. `names` has other names of
    links, by those in the case."""
    try:
        found = links_in_contact(case, engine, seed)
    except DynxError:
        return ""
    if not found:
        return f"none touch in {STATES} states within limits in which mimic joints follow; in others some do"
    deepest = sorted(found.items(), key=lambda item: -item[1].depth)
    listed = [
        f"{' and '.join((names or {}).get(name, name) for name in pair)} touch in {each.states} of {STATES} "
        f"states, up to {1e3 * each.depth:.3g} mm deep"
        for pair, each in deepest[:_MAX_PAIRS]
    ]
    more = len(deepest) - _MAX_PAIRS
    pairs = "pair" if more == 1 else "pairs"
    return "; ".join([*listed, *([f"and {more} more {pairs}"] if more > 0 else [])])


def deepest_contact(case: Case, engines: Iterable[str], seed: int) -> Mapping[str, float] | None:
    """Return the positions of the joints at which two links penetrate each other most deeply, in the first of
    these engines in which any do; None where none touch."""
    for engine in engines:
        try:
            found = links_in_contact(case, engine, seed)
        except DynxError:
            continue
        if found:
            return max(found.values(), key=lambda contact: contact.depth).positions
    return None


def links_in_contact(case: Case, engine: str, seed: int) -> Mapping[tuple[str, str], LinkContact]:
    """Find the pairs of links that touch; raises EngineError where the engine refuses the file.

    Engines merge links on fixed joints, so each shape is given a name that tells its own link.
    """
    model = model_without_mimics(case.source, case.base)
    base = 7 if model.floating else 0
    source, owners = _with_named_shapes(without_meshes(case.source))
    found: dict[tuple[str, str], LinkContact] = {}
    with (
        temporary_document(source) as path,
        silence(),
        loader_class(engine)(path, model) as robot,
    ):
        for q in following_positions(case, STATES, seed):
            depths: dict[tuple[str, str], float] = {}
            for shapes, depth in robot.contacts(q).items():
                one, other = sorted(owners.get(shape, shape) for shape in shapes)
                depths[one, other] = max(depth, depths.get((one, other), 0.0))
            for pair, depth in depths.items():
                contact = found.setdefault(pair, LinkContact())
                contact.states += 1
                if depth > contact.depth:
                    contact.depth = depth
                    contact.positions = dict(zip(model.position_names, q[base:].tolist(), strict=True))
    return found


def _with_named_shapes(source: XmlSource) -> tuple[XmlSource, dict[str, str]]:
    """Name every collision shape; return the links to which the shapes belong, by these names."""
    shapes = [(shape, link) for link in source.root.all("link") for shape in link.all("collision")]
    names = [f"collision shape {number}" for number in range(len(shapes))]
    edits = (
        source.attribute_edit(shape, "name", name) for name, (shape, _) in zip(names, shapes, strict=True)
    )
    owners = {name: link.attributes.get("name", "") for name, (_, link) in zip(names, shapes, strict=True)}
    return source.apply(*edits), owners


def following_positions(case: Case, count: int, seed: int) -> Floats:
    """Draw positions (count, nq) of all moving joints within their limits, in which mimic joints follow."""
    free, model = model_without_mimics(case.source, case.base), case.model
    q = draw_states(model, count, seed).q
    base = 7 if model.floating else 0
    columns = {name: q[:, base + k] for k, name in enumerate(model.position_names)}
    for joint in model.joints:
        if joint.mimic is not None and joint.mimic.joint in columns:
            columns[joint.name] = joint.mimic.multiplier * columns[joint.mimic.joint] + joint.mimic.offset
    held = np.zeros(count)
    return np.column_stack([q[:, :base], *(columns.get(name, held) for name in free.position_names)])


# Reference values for a file: the robot as dynx reads it, evaluated by the algorithms of `dynx.rbd`.
#
# Coordinates are those of all moving joints, mimic joints included, as engines load them: the ``<mimic>``
# tags are removed. Gravity is tilted, so that a value in the wrong frame differs. ``dynx agree`` compares
# the backend `reference`, which evaluates here, with a 50-digit referee.


TILTED_GRAVITY: Vector = (0.3, -0.7, -9.81)
"""Gravity [m/s^2] at which files are compared, not parallel to any axis of a frame."""

MAX_TIPS = 4
"""Largest number of branches at whose ends Jacobians are compared."""

MAX_LIMIT_DISTANCE = 100.0
"""Distance from zero [rad or m] beyond which limits are ignored and states are drawn near zero, because
rounding of the coordinate would dominate the errors there."""


@dataclass(frozen=True, eq=False)
class States:
    """n states: q (n, nq), v, a, tau (n, nv)."""

    q: Floats
    v: Floats
    a: Floats
    tau: Floats

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True, eq=False)
class ReferenceValues:
    """Values of all compared quantities for `model` at `states`.

    `poses` (n, n_links, 4, 4) of the links in the world; by link `jacobians` (n, 6, nv) of its frame, linear
    rows first, in axes of the world; `mass_matrix` (n, nv, nv); `torque` (n, nv) for the accelerations of
    `states`, and `bias` (n, nv) the part of it without acceleration. `solvable` says whether forward dynamics
    has a solution. `kinematics_only` says that the file has no inertial data (DX118), so that nothing else
    can be compared.
    """

    model: Model
    states: States
    poses: Floats
    jacobians: Mapping[str, Floats]
    mass_matrix: Floats
    torque: Floats
    bias: Floats
    solvable: bool
    kinematics_only: bool = False

    def first(self, count: int) -> ReferenceValues:
        """Keep the first `count` states."""
        states = self.states
        return replace(
            self,
            states=States(states.q[:count], states.v[:count], states.a[:count], states.tau[:count]),
            poses=self.poses[:count],
            jacobians={link: J[:count] for link, J in self.jacobians.items()},
            mass_matrix=self.mass_matrix[:count],
            torque=self.torque[:count],
            bias=self.bias[:count],
        )

    def required_torque(self, a: Floats) -> Floats:
        """Compute tau (n, nv) that accelerations a (n, nv) require at the states."""
        return np.asarray(np.einsum("nij,nj->ni", self.mass_matrix, a) + self.bias)


def model_without_mimics(source: XmlSource, base: Base) -> Model:
    """Read the robot of a document in the coordinates of all its moving joints, in tilted gravity.

    The base of MJCF and SDF is that of the document.
    """
    if format_of_root(source.root.tag) != "urdf":
        model = read_model(source.text, source.source, gravity=TILTED_GRAVITY)
        return replace(model, joints=tuple(replace(joint, mimic=None) for joint in model.joints))
    joints = source.root.all("joint")
    followers = [mimic for joint in joints for mimic in joint.all("mimic")]
    free = source.apply(*(source.removal(mimic) for mimic in followers)) if followers else source
    return read_model(free.text, source.source, base=base, gravity=TILTED_GRAVITY)


def draw_states(model: Model, count: int, seed: int) -> States:
    """Draw random states: positions in the middle four fifths of the range of each joint, which extends to
    its limits, or to pi [rad] or 1 [m] from zero (or from the limit nearest to zero) if these are closer;
    velocities and accelerations up to 2.

    Engines that compute a step apply a force at a limit, so no limit may be reached within a step. For a
    range of zero width, positions are drawn as without limits. A ball joint is turned by nine tenths of a
    random rotation within its largest angle.
    """
    rng = np.random.default_rng(seed)
    q = model.random(rng, count)
    for first in model.ball_places:
        quat = slice(first, first + 4)
        q[:, quat] = quat_exp(0.9 * quat_log(q[:, quat]))
    joints = [joint for joint in model.coordinate_joints if joint.type != "ball"]
    places = [model.position_index(joint.name) for joint in joints]
    turning = np.array([joint.type != "prismatic" for joint in joints], dtype=bool)
    reach = np.where(turning, np.pi, 1.0)
    lower, upper = model.lower[places], model.upper[places]
    # If zero is outside the limits, positions near the closest limit are drawn.
    near = np.clip(0.0, lower, np.maximum(upper, lower))
    near = np.where((np.abs(near) < reach) | (np.abs(near) > MAX_LIMIT_DISTANCE), 0.0, near)
    low, high = np.maximum(lower, near - reach), np.minimum(upper, near + reach)
    room = low < high
    low, high = np.where(room, low, -reach), np.where(room, high, reach)
    q[:, places] = low + (high - low) * rng.uniform(0.1, 0.9, (count, len(places)))
    v, a, tau = rng.uniform(-2.0, 2.0, (3, count, model.nv))
    return States(q, v, a, tau)


def with_positions(model: Model, states: States, positions: Mapping[str, float]) -> States:
    """Add a state: the first one, with these joints at these positions."""
    q = states.q[0].copy()
    base = 7 if model.floating else 0
    for k, name in enumerate(model.position_names):
        q[base + k] = positions.get(name, q[base + k])
    added = (q, states.v[0], states.a[0], states.tau[0])
    columns = (states.q, states.v, states.a, states.tau)
    return States(*(np.vstack([column, row]) for column, row in zip(columns, added, strict=True)))


def reference_values(model: Model, states: States) -> ReferenceValues:
    """Compute the reference values; forward dynamics gets the `torque` of the previous state."""
    # A file without any mass gives NaN here, which is compared, so NumPy's warning is silenced.
    with np.errstate(all="ignore"), ReferenceBackend(model) as reference:
        # Frames of links come first; engines do not have the frames that dynx adds.
        poses = reference.forward_kinematics(states.q)[:, : len(model.links)]
        bias = reference.bias_torque(states.q, states.v)
        torque = reference.inverse_dynamics(states.q, states.v, states.a)
        mass_matrix = reference.mass_matrix(states.q)
        return ReferenceValues(
            model=model,
            # The torques of other states have the right magnitude for the robot but do not compensate its
            # weight.
            states=States(states.q, states.v, states.a, np.roll(torque, 1, axis=0)),
            poses=poses,
            jacobians={tip: reference.jacobian(states.q, tip) for tip in _tips(model)},
            mass_matrix=mass_matrix,
            torque=torque,
            bias=bias,
            solvable=bool(model.nv) and not singular_coordinates(model) and _is_regular(mass_matrix),
        )


def referee_error(reference: ReferenceValues) -> float:
    """Return the relative error of the reference values themselves at the first state, against 50 digits."""
    if not reference.model.nv:
        return 0.0
    states, referee = reference.states, Referee(reference.model)
    exact_torque = referee.inverse_dynamics(states.q[:1], states.v[:1], states.a[:1])
    exact_mass = referee.mass_matrix(states.q[:1])
    pairs = ((exact_torque, reference.torque), (exact_mass, reference.mass_matrix))
    return max(_ratio((exact - found[:1]).astype(np.float64), found) for exact, found in pairs)


def _is_regular(mass_matrix: Floats) -> bool:
    """Check that the mass matrices (n, nv, nv) stay regular under errors within the tolerance of engines.

    Scaled to a unit diagonal, each must have its eigenvalues further from zero than `BAR`: nearer ones leave
    no digit of the acceleration, as on a floating base of 1e-15 kg that carries an arm.
    """
    diagonal = np.abs(np.einsum("nii->ni", mass_matrix))
    if not np.isfinite(mass_matrix).all() or not diagonal.all():
        return False
    scale = 1.0 / np.sqrt(diagonal)
    values = np.linalg.eigvalsh(mass_matrix * scale[:, :, None] * scale[:, None, :])
    return bool(np.all(np.abs(values) > BAR))


def _ratio(gap: Floats, values: Floats) -> float:
    magnitude = float(np.max(np.abs(values), initial=0.0))
    return float(np.max(np.abs(gap), initial=0.0)) / (magnitude or 1.0)


def _tips(model: Model) -> tuple[str, ...]:
    """Choose links without children that some joint moves, spread over the tree."""
    if not model.nv:
        return ()
    parents = {joint.parent for joint in model.joints}
    moved = {frame.name for frame in model.mechanism.frames if frame.body >= 0}
    ends = [link.name for link in model.links if link.name not in parents and link.name in moved]
    ends = ends or [model.links[-1].name]
    return tuple(ends[:: max(1, len(ends) // MAX_TIPS)][:MAX_TIPS])


# Bounds of what is examined: engines and proofs load a file dozens of times, and engines are recursive.


MAX_BYTES = 8 * 1024 * 1024
"""Largest text [bytes]; the largest description in public use has less than 2 MiB."""

MAX_ELEMENTS = 100_000
"""Largest number of elements."""

MAX_LINKS = 1000
"""Largest number of links."""

MAX_CHAIN = 500
"""Largest number of links between the root and a tip: a chain of 3,800 ends the process in Pinocchio 4.1."""


def require_bounded(source: XmlSource) -> None:
    """Raise DescriptionError for a document larger than is examined.

    The reader itself bounds the links of MJCF and SDF.
    """
    if len(source.data) > MAX_BYTES:
        _refuse(source, None, f"has {len(source.data)} bytes; at most {MAX_BYTES} are examined")
    for number, element in enumerate(source.root.walk()):
        if number >= MAX_ELEMENTS:
            _refuse(source, element, f"has more than {MAX_ELEMENTS} elements, the most that are examined")
    if format_of_root(source.root.tag) != "urdf":
        return
    links = source.root.all("link")
    if len(links) > MAX_LINKS:
        excess = links[MAX_LINKS]
        _refuse(source, excess, f"has {len(links)} links; at most {MAX_LINKS} are examined")
    _require_short_chains(source)


def _require_short_chains(source: XmlSource) -> None:
    carried = {_link(joint, "child"): joint for joint in source.root.all("joint")}
    below: dict[str, list[str]] = {}
    for child, joint in carried.items():
        below.setdefault(_link(joint, "parent"), []).append(child)
    # Links of a cycle are below no root, so that they are not reached.
    level = [name for name in below if name not in carried]
    for depth in count():
        if not level:
            return
        if depth > MAX_CHAIN:
            chain = f"has a chain of more than {MAX_CHAIN} links, the most that are examined"
            _refuse(source, carried[level[0]], chain)
        level = [child for name in level for child in below.get(name, ())]


def _link(joint: SourceElement, role: str) -> str:
    element = joint.first(role)
    return "" if element is None else element.attributes.get("link", "")


def _refuse(source: XmlSource, element: SourceElement | None, message: str) -> None:
    line = None if element is None else element.line
    raise DescriptionError(message, source=source.source, line=line)


KINEMATICS, JACOBIAN = "forward_kinematics", "jacobian"
MASS, TORQUE, ACCELERATION = "mass_matrix", "inverse_dynamics", "forward_dynamics"
LOADING = "loading"
"""Quantity in an effect on an engine that refuses the file."""

RESULT = "result"
"""Quantity in an effect on an engine that refuses nothing, but whose results on the file are not used."""

QUANTITIES = (KINEMATICS, JACOBIAN, MASS, TORQUE, ACCELERATION)
"""Compared quantities. Forward dynamics is compared by the torque that the computed acceleration requires."""


@dataclass(frozen=True, eq=False)
class EngineOutput:
    """Deviations of one engine from the reference values of one file.

    `deviation` maps a quantity to engine minus reference: by link (n, 4, 4) or (n, 6, nv) for poses and
    Jacobians, under "" (n, nv, nv) or (n, nv) for the rest, (n, 2, nv) for accelerations. A quantity that
    the engine could not compute is in `failed`, with its error message; `refused` is the message with which
    it refused the file, `not_used` the reason why dynx does not use the engine on it.
    """

    engine: str
    refused: str | None = None
    not_used: str | None = None
    deviation: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)
    failed: Mapping[str, str] = field(default_factory=dict)
    description: LoadedModel | None = None

    @property
    def no_results(self) -> str | None:
        """Reason why there are no results; None where there are some."""
        return self.not_used if self.refused is None else self.refused

    @property
    def missing(self) -> str:
        """The quantity in which an engine without results shows: `LOADING` or `RESULT`."""
        return RESULT if self.refused is None else LOADING

    def first(self, count: int) -> EngineOutput:
        """Keep the first `count` states."""
        deviation = {
            quantity: {part: gap[:count] for part, gap in parts.items()}
            for quantity, parts in self.deviation.items()
        }
        return replace(self, deviation=deviation)


@dataclass(frozen=True, eq=False)
class Examination:
    """Outputs of all engines for one case, and the reference values of the case's own text."""

    reference: ReferenceValues
    outputs: Mapping[str, EngineOutput]

    def first(self, count: int) -> Examination:
        """Keep the first `count` states."""
        return Examination(
            self.reference.first(count), {name: each.first(count) for name, each in self.outputs.items()}
        )

    def scale(self, quantity: str, engine: str) -> float:
        """Return the divisor of a deviation: the largest reference value, or the engine's largest value if
        that is 0.

        For a backward error, which is already relative, it is 1.
        """
        if quantity == ACCELERATION:
            return 1.0
        reference = self.reference
        expected = {
            KINEMATICS: reference.poses,
            JACOBIAN: np.stack(list(reference.jacobians.values())) if reference.jacobians else np.zeros(1),
            MASS: reference.mass_matrix,
            TORQUE: reference.torque,
        }[quantity]
        largest = float(np.max(np.abs(expected), initial=0.0))
        if largest > 0.0:
            return largest
        return _largest(self.outputs[engine].deviation.get(quantity, {})) or 1.0

    def error(self, engine: str, quantity: str) -> float:
        """Return the largest deviation over its scale; infinite where the engine computed nothing."""
        output = self.outputs[engine]
        if output.no_results is not None or quantity in output.failed:
            return float("inf")
        return _number(_largest(output.deviation.get(quantity, {})) / self.scale(quantity, engine))

    def errors(self, engine: str) -> dict[str, float]:
        """Return `error` of every quantity that was examined; empty where the file was refused."""
        output = self.outputs[engine]
        if output.no_results is not None:
            return {}
        examined = [quantity for quantity in QUANTITIES if quantity in {*output.deviation, *output.failed}]
        return {quantity: self.error(engine, quantity) for quantity in examined}

    def max_error(self, engine: str) -> float:
        """Return the largest of `errors`, infinite where the file was refused."""
        if self.outputs[engine].no_results is not None:
            return float("inf")
        return max(self.errors(engine).values(), default=0.0)

    def joint_errors(self, engine: str, other: str | None = None) -> dict[str, float]:
        """Return the errors of inverse dynamics joint by joint, against the reference or another engine,
        relative to the joint's largest reference torque (at least 1e-9 of the largest torque of all
        joints)."""
        mine = self.outputs[engine].deviation.get(TORQUE, {}).get("")
        theirs = None if other is None else self.outputs[other].deviation.get(TORQUE, {}).get("")
        if mine is None or (other is not None and theirs is None):
            return {}
        gap = np.max(np.abs(mine if theirs is None else mine - theirs), axis=0, initial=0.0)
        right = np.max(np.abs(self.reference.torque), axis=0, initial=0.0)
        size = np.maximum(right, 1e-9 * np.max(right, initial=0.0))
        ratio = np.where(gap > 0.0, gap / np.where(size > 0.0, size, 1.0), 0.0)
        return dict(zip(coordinate_names(self.reference), ratio.tolist(), strict=True))

    def pair_error(self, engine: str, other: str, quantity: str) -> float:
        """Return the deviation of two engines from each other, relative to its scale; infinite where one
        computed nothing."""
        one, two = self.outputs[engine], self.outputs[other]
        if quantity in {*one.failed, *two.failed} or one.no_results or two.no_results:
            return float("inf")
        gap = max_change(one.deviation.get(quantity, {}), two.deviation.get(quantity, {}))
        return _number(gap / self.scale(quantity, engine))


class Examiner:
    """Examiner of cases of one robot, with the same engines or variants, number of states and seed."""

    def __init__(
        self,
        engines: Collection[str],
        samples: int,
        seed: int,
        positions: Mapping[str, float] | None = None,
        apart: EngineProcess | None = None,
    ) -> None:
        """`seed` selects the random states; `positions` of the joints, by name, are one more state.
        `apart` is the process in which engines load MJCF and SDF.
        """
        self._apart = apart or EngineProcess()
        self.engines = {name: loader_class(name) for name in engines}
        self._samples = samples
        self.seed = seed
        self._positions = positions
        # One remedy after another leaves the robot as it is.
        self._values = lru_cache(maxsize=8)(self._compute_reference)

    def with_samples(self, samples: int) -> Examiner:
        """Return an examiner with the same engines and seed, and another number of states."""
        return Examiner(self.engines, samples, self.seed, self._positions, self._apart)

    def of_engines(self, names: Collection[str]) -> Examiner:
        """Return an examiner of the same states with these engines or variants, in the same process."""
        return Examiner(names, self._samples, self.seed, self._positions, self._apart)

    def for_format(self, form: Format) -> Examiner:
        """Return an examiner with those of the engines that load files of a format."""
        return self.of_engines([name for name, kind in self.engines.items() if form in kind.FORMATS])

    def for_ball_joints(self) -> Examiner:
        """Return an examiner with those of the engines that take ball joints."""
        return self.of_engines([name for name, kind in self.engines.items() if kind.takes_ball_joints])

    def close(self) -> None:
        """End the process in which engines load MJCF and SDF, and remove the folders of these files."""
        self._apart.close()

    def at(self, positions: Mapping[str, float]) -> Examiner:
        """Return an examiner that examines the same states, and one with the joints at these positions."""
        return Examiner(self.engines, self._samples, self.seed, positions, self._apart)

    def reference(self, case: Case) -> ReferenceValues:
        """Compute the reference values of a case at random states."""
        return self._values(without_meshes(case.source).text, case.source.source, case.base)

    def _compute_reference(self, text: str, name: str, base: Base) -> ReferenceValues:
        source = XmlSource(text, name)
        model = model_without_mimics(source, base)
        states = draw_states(model, self._samples, self.seed)
        if self._positions is not None:
            states = with_positions(model, states, self._positions)
        values = reference_values(model, states)
        kinematics_only = not has_inertial_data(Case(source, base))
        if format_of_root(source.root.tag) != "urdf":
            moved = {joint.child for joint in model.joints}
            massive = (each.inertial for each in model.links if model.floating or each.name in moved)
            kinematics_only = not any(each and (each.mass or each.tensor.any()) for each in massive)
        return replace(values, kinematics_only=kinematics_only)

    def examine(
        self,
        case: Case,
        engines: Collection[str] | None = None,
        *,
        reference: ReferenceValues | None = None,
        describe: bool = False,
    ) -> Examination:
        """Load the text of the case in the engines and compute their errors; a given `reference` is not
        computed again."""
        reference = reference or self.reference(case)
        chosen = [name for name in self.engines if engines is None or name in engines]
        with ExitStack() as files:
            paths = {
                meshes: files.enter_context(
                    temporary_document(text, mesh_boxes=meshes, folders=self._apart.folders)
                )
                for meshes, text in self._engine_inputs(case, chosen)
            }
            tasks = [
                EngineTask(
                    name,
                    self.engines[name],
                    paths[self.engines[name].loads_meshes],
                    case.calls,
                    reference,
                    describe,
                )
                for name in chosen
            ]
            # The readers of these formats end the process more often than those of URDF, for which dynx
            # knows each such fault.
            found = map(evaluate, tasks) if case.form == "urdf" else self._apart.evaluate(tasks)
            outputs = {output.engine: output for output in found}
        return Examination(reference, {name: outputs[name] for name in chosen})

    def without_unused(self, source: XmlSource) -> XmlSource:
        """Remove the shapes that none of the engines loads."""
        return without_meshes(source, collisions=not any(kind.loads_meshes for kind in self.engines.values()))

    def _engine_inputs(self, case: Case, chosen: Sequence[str]) -> Iterator[tuple[bool, XmlSource]]:
        """Yield the text for engines that load meshes (True) and for those that load none (False)."""
        for meshes in {self.engines[name].loads_meshes for name in chosen}:
            yield meshes, without_meshes(case.source, collisions=not meshes)


@dataclass(frozen=True, eq=False)
class EngineTask:
    """A file to load in one engine, and the reference values with which it is compared."""

    engine: str
    kind: type[LoadedRobot]
    path: Path
    calls: frozenset[str]
    reference: ReferenceValues
    describe: bool


def evaluate(task: EngineTask) -> EngineOutput:
    """Load the file of a task and compute the deviations of the engine."""
    engine, path = task.engine, task.path
    try:
        # Output of engines is suppressed; the report contains their messages in order.
        with (
            silence(),
            np.errstate(all="ignore"),
            task.kind(path, task.reference.model, task.calls) as robot,
        ):
            return _outputs_of(engine, robot, task.reference, task.describe)
    except UnicodeDecodeError:
        # Raised by bindings that return names as text, for bytes of another encoding.
        return EngineOutput(engine, refused=f"{engine} cannot return names that are not in UTF-8")
    except DynxError as error:
        # The name of the temporary file differs each time, so it is removed from messages.
        reason = str(error).replace(str(path), path.name).replace(f"{path.parent}{os.sep}", "")
        if isinstance(error, UnusableEngineError):
            return EngineOutput(engine, not_used=reason)
        return EngineOutput(engine, refused=reason)


MAX_ENGINE_TIME = 60.0
"""Time limit [s] of one engine on one file in MJCF or SDF, loading and all quantities."""


class EngineProcess:
    """A process in which engines load files, so that an engine that ends it ends no more than that; and the
    `folders` of these files."""

    def __init__(self) -> None:
        self._workers: Workers | None = None
        self.folders = DocumentFolders()

    def evaluate(self, tasks: Sequence[EngineTask]) -> Iterator[EngineOutput]:
        """Yield the output of each task; an engine that ended the process, or took too long, is not used."""
        if self._workers is None:
            self._workers = Workers(evaluate, 1, MAX_ENGINE_TIME)
        for result in self._workers.run(tasks):
            if result.failure is None:
                yield result.value
            elif result.failure.kind == "defect":
                raise result.failure.error
            else:
                engine = tasks[result.index].engine
                yield EngineOutput(engine, not_used=f"{engine} {result.failure.message} on this file")

    def close(self) -> None:
        """End the process, and remove the folders."""
        self.folders.close()
        if self._workers is not None:
            self._workers.close()
            self._workers = None


def _outputs_of(engine: str, robot: LoadedRobot, reference: ReferenceValues, describe: bool) -> EngineOutput:
    states = reference.states
    deviation: dict[str, dict[str, Floats]] = {}
    failed: dict[str, str] = {}

    def record(quantity: str, compute: Callable[[], dict[str, Floats]]) -> None:
        try:
            deviation[quantity] = compute()
        except DynxError as error:
            failed[quantity] = str(error)

    record(KINEMATICS, lambda: _pose_deviation(robot, reference))
    if reference.model.nv:
        record(JACOBIAN, lambda: _jacobian_deviation(robot, reference))
    if reference.model.nv and not reference.kinematics_only:
        record(MASS, lambda: {"": _evaluate_samples(robot.mass_matrix, states.q) - reference.mass_matrix})
        record(
            TORQUE,
            lambda: {
                "": _evaluate_samples(robot.inverse_dynamics, states.q, states.v, states.a) - reference.torque
            },
        )
        if reference.solvable:
            record(ACCELERATION, lambda: {"": _acceleration_deviation(robot, reference)})
    description = robot.describe() if describe else None
    return EngineOutput(engine, deviation=deviation, failed=failed, description=description)


def _evaluate_samples(compute: Callable[..., Floats], *columns: Floats) -> Floats:
    return np.stack([compute(*sample) for sample in zip(*columns, strict=True)])


def _pose_deviation(robot: LoadedRobot, reference: ReferenceValues) -> dict[str, Floats]:
    gap = _evaluate_samples(robot.link_poses, reference.states.q) - reference.poses
    names = [link.name for link in reference.model.links]
    # Poses of a link that the engine does not have are all NaN; one pose is NaN where it cannot be computed.
    return {name: gap[:, k] for k, name in enumerate(names) if not np.isnan(gap[:, k]).all()}


def _jacobian_deviation(robot: LoadedRobot, reference: ReferenceValues) -> dict[str, Floats]:
    gaps = {}
    for link, expected in reference.jacobians.items():
        found = _evaluate_samples(lambda q, link=link: robot.jacobian(q, link), reference.states.q)
        if not np.isnan(found).all():
            gaps[link] = found - expected
    return gaps


def _acceleration_deviation(robot: LoadedRobot, reference: ReferenceValues) -> Floats:
    """Return the backward errors for the torques of the states, and for torques that accelerate in the
    opposite direction.

    A force that acts on one side only, such as that of a joint limit, shows in one of the two.
    """
    forward = reference.states.tau
    opposite = 2.0 * reference.bias - forward
    return np.stack([_backward_error(robot, reference, tau) for tau in (forward, opposite)], axis=1)


def _backward_error(robot: LoadedRobot, reference: ReferenceValues, tau: Floats) -> Floats:
    states = reference.states
    found = _evaluate_samples(robot.forward_dynamics, states.q, states.v, tau)
    required = reference.required_torque(found)
    terms = np.einsum("nij,nj->ni", np.abs(reference.mass_matrix), np.abs(found))
    terms = terms + np.abs(reference.bias) + np.abs(tau)
    return np.asarray((required - tau) / np.max(terms, axis=-1, initial=0.0, keepdims=True))


def max_change(before: Mapping[str, Floats], after: Mapping[str, Floats]) -> float:
    """Return the largest difference between two sets of deviations, where both have the same parts.

    Infinite where their shapes differ, because the robots then have different coordinates.
    """
    gaps = [0.0]
    for part in before.keys() & after.keys():
        if before[part].shape != after[part].shape:
            return float("inf")
        gaps.append(_size(before[part] - after[part]))
    return max(gaps)


def coordinate_names(reference: ReferenceValues) -> tuple[str, ...]:
    """Return the names of the entries of v."""
    base = ("base x", "base y", "base z", "base roll", "base pitch", "base yaw")
    return (base if reference.model.floating else ()) + reference.model.coordinate_names


def _number(ratio: float) -> float:
    """Return the ratio, or infinity for NaN, because values too large to be compared do not agree."""
    return float("inf") if np.isnan(ratio) else ratio


def _largest(parts: Mapping[str, Floats]) -> float:
    return max((_size(part) for part in parts.values()), default=0.0)


def _size(array: Floats) -> float:
    size = np.abs(array)
    return float(np.max(np.where(np.isnan(size), np.inf, size), initial=0.0))
