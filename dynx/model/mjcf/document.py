"""A document in MJCF: its sections, files included, classes of defaults, settings of the compiler.

The format is that of MuJoCo 4.0 (https://mujoco.readthedocs.io, XML reference).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

import numpy as np

from dynx.errors import escaped, nearest, shown
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh, reason_unknown
from dynx.model.mjcf.options import MjcfOptions
from dynx.model.topology import MAX_LINKS
from dynx.model.xml.reading import Element
from dynx.model.xml.several_files import FilesReading
from dynx.model.xml.values import Reading
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_about, rotation_from_quat, rotation_of_z

_ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
WITH_DEFAULTS = frozenset(["geom", "joint", "site", "mesh", "material", "equality", "tendon"])
"""Elements of a class of defaults from which elements that are read take attributes that they lack; those of
equality and tendon are for all elements of the section."""

ACTUATORS = frozenset(
    ["adhesion", "cylinder", "damper", "dcmotor", "general", "intvelocity", "motor", "muscle"]
) | {"plugin", "position", "velocity"}
"""Elements of ``<actuator>``, whose attributes a class of defaults holds for all of them together."""

_POSE = frozenset(["pos", *_ORIENTATIONS])
_NAMED = frozenset(["name", "class", "group", "user"])
_SOFTNESS = frozenset(["margin", "solimp", "solref"])
_OF_EQUALITY = frozenset(["active", "solimp", "solref"])
TENDON_FORCES = frozenset(
    ["actuatorfrclimited", "actuatorfrcrange", "armature", "damping", "frictionloss", "limited", "range"]
) | {"springlength", "springyield", "stiffness"}
"""Attributes of a tendon that are read."""
TENDON_SOFTNESS = frozenset(["margin", "solimpfriction", "solimplimit", "solreffriction", "solreflimit"])
"""Attributes of a tendon for MuJoCo's constraint solver."""
_OF_TENDON = TENDON_FORCES | TENDON_SOFTNESS | {"group", "user"}
ATTRIBUTES: dict[str, frozenset[str]] = {
    "body": _POSE | {"name", "childclass", "mocap", "gravcomp", "user", "sleep", "fuse", "simple"},
    "frame": _POSE | {"name", "childclass"},
    "key": frozenset(["name", "time", "qpos", "qvel", "act", "ctrl", "mpos", "mquat", "plastic"]),
    "inertial": _POSE | {"mass", "diaginertia", "fullinertia"},
    "equality": _OF_EQUALITY,
    "tendon": _OF_TENDON | {"material", "rgba", "width"},
    "fixed": _OF_TENDON | {"name", "class"},
    "freejoint": frozenset(["name", "group", "align"]),
    "replicate": frozenset(["count", "offset", "euler", "sep", "childclass", "prefix"]),
    "include": frozenset(["file"]),
    "attach": frozenset(["model", "body", "frame", "prefix"]),
    "joint": _NAMED
    | {"actuatorfrclimited", "actuatorfrcrange", "actuatorgravcomp", "armature", "axis", "damping", "margin"}
    | {"frictionloss", "limited", "pos", "range", "ref", "solimpfriction", "solimplimit", "solreffriction"}
    | {"solreflimit", "springdamper", "springref", "springyield", "stiffness", "type"},
    "geom": _NAMED
    | _POSE
    | _SOFTNESS
    | {"adhesion", "castshadow", "conaffinity", "condim", "contype", "density", "fitscale", "fluidcoef"}
    | {"fluidshape", "friction", "fromto", "gap", "hfield", "mass", "material", "mesh", "priority", "rgba"}
    | {"shellinertia", "size", "solmix", "surfacevel", "type"},
    "site": _NAMED | _POSE | {"fromto", "material", "mesh", "rgba", "size", "type"},
    "compiler": frozenset(
        [
            "alignfree",
            "angle",
            "assetdir",
            "autolimits",
            "balanceinertia",
            "boundinertia",
            "boundmass",
            "conflict",
            "coordinate",
            "discardvisual",
            "eulerseq",
            "fitaabb",
            "fusestatic",
            "inertiafromgeom",
            "inertiagrouprange",
            "meshdir",
            "passthrough",
            "savecanonical",
            "savecompiled",
            "saveinertial",
            "settotalmass",
            "strippath",
            "texturedir",
            "usethread",
        ]
    )
    # Older versions of MuJoCo have these, and they move no body.
    | {"convexhull", "exactmeshinertia"},
}
"""Attributes of the elements that are read. MuJoCo refuses others, and so does dynx: they are misspelt."""

WITH_CONTENT_OF_THEIR_OWN = frozenset(["composite", "flexcomp"])
"""Elements whose content has attributes of its own, under tags that stand elsewhere too."""

MAX_ELEMENTS = 10 * MAX_LINKS
"""Largest number of elements of a model with its included files, and of copies that ``<replicate>`` makes."""

_SHORTEST = 1e-14
"""Length of a direction below which MuJoCo refuses it."""


@dataclass
class MjcfReading(FilesReading):
    """State of reading a model in MJCF, whose elements may come from several files and attached models."""

    origins: dict[int, tuple[Element, Origin]] = field(default_factory=dict)
    """Element of an attached model, and its origin, by the identity of the element."""
    copied: int = 0
    """Number of copies of elements that ``<attach>`` and ``<replicate>`` made, in all models together."""

    def count_copy(self, element: Element, what: str) -> None:
        """Count a copy of an element; raise DescriptionError for too many."""
        self.copied += 1
        if self.copied > MAX_ELEMENTS:
            raise self.error(element, f"{what} makes more than {MAX_ELEMENTS} elements")

    def like(self, element: Element, attributes: dict[str, str]) -> Element:
        """Return an element at the place of another one, with other attributes and the same content."""
        new = super().like(element, attributes)
        held = self.origins.get(id(element))
        if held is not None:
            self.origins[id(new)] = (new, held[1])
        return new

    def some_numbers(
        self, element: Element, attribute: str, what: str, least: int, most: int
    ) -> tuple[float, ...]:
        """Return a required attribute of `least` to `most` finite numbers."""
        given = len(self.attribute(element, attribute, what).split())
        return self.numbers(element, attribute, what, min(max(given, least), most))

    def flag(self, element: Element, attribute: str, what: str, default: bool) -> bool:
        """Return an attribute that is ``true`` or ``false``."""
        return self.choice(element, attribute, what, ("false", "true"), str(default).lower()) == "true"


@dataclass(frozen=True)
class Compiler:
    """Settings of ``<compiler>`` that change what the other elements mean."""

    degrees: bool = True
    euler_sequence: str = "xyz"
    autolimits: bool = True
    inertia_from_geom: str = "auto"
    inertia_groups: tuple[float, ...] = (0.0, 5.0)
    balance_inertia: bool = False
    bound_mass: float = 0.0
    bound_inertia: float = 0.0
    total_mass: float = -1.0
    mesh_folder: str = ""
    texture_folder: str = ""
    strip_path: bool = False
    align_free: bool = False
    fit_bounding_box: bool = False

    def radians(self, angle: float) -> float:
        """Return an angle of the file in radians."""
        return math.radians(angle) if self.degrees else angle

    def euler(self, angles: Iterable[float]) -> Floats:
        """Return the rotation (3, 3) by these angles of the file about the axes of `eulerseq` in turn.

        Small letters are axes that turn along.
        """
        R = np.eye(3)
        for letter, angle in zip(self.euler_sequence, angles, strict=True):
            axis = np.eye(3)["xyz".index(letter.lower())]
            one = turn(axis, self.radians(angle))
            R = R @ one if letter.islower() else one @ R
        return R

    def path(self, folder: str, filename: str) -> str:
        """Return the path of an asset from the folder of the model."""
        name = PurePath(filename).name if self.strip_path else filename
        return (PurePath(folder) / name).as_posix()


@dataclass(frozen=True)
class Origin:
    """The settings and the file of the model that an element is of."""

    compiler: Compiler
    source: str


@dataclass(frozen=True)
class MjcfText:
    """A model in MJCF: its sections, with the files included and other models attached."""

    root: Element
    compiler: Compiler
    defaults: dict[str, dict[str, dict[str, str]]]
    main_class: str
    reading: MjcfReading
    options: MjcfOptions
    package_dirs: tuple[str, ...] = ()

    def origin(self, element: Element) -> Origin:
        """Return the settings and the file of the model of an element: this one, or an attached one."""
        held = self.reading.origins.get(id(element))
        return Origin(self.compiler, self.reading.source) if held is None else held[1]

    def compiler_of(self, element: Element) -> Compiler:
        """Return the settings that give the numbers and names of an element their meaning."""
        return self.origin(element).compiler

    def sections(self, tag: str) -> Iterator[Element]:
        """Yield the content of all sections of that tag."""
        for section in self.root.all(tag):
            yield from section.children

    def named_elements(self, section: str, tags: Collection[str], what: str) -> Iterator[Element]:
        """Yield the content of all sections of that tag, whose elements have `tags` and different names.

        Raises DescriptionError for another tag, and for a name that two of them have. `what` is what an
        element is called, for messages.
        """
        names = set[str]()
        for element in self.sections(section):
            tag, name = element.tag, element.attributes.get("name", "")
            if tag not in tags:
                raise self.reading.error(
                    element, f"<{section}> has the unknown element <{escaped(tag)}>{nearest(tag, tags)}"
                )
            if not name:
                yield element
                continue
            self.reading.name(element, "name", f"a{'n' if what[0] in 'aeiou' else ''} {what}")
            if name in names:
                raise self.reading.error(element, f"two {what}s have the name {shown(name)}")
            names.add(name)
            yield element

    def resolved(self, element: Element, childclass: str | None, tag: str | None = None) -> Element:
        """Return an element with the attributes that it has from its class of defaults.

        That is the class that it names, else the `childclass` of the bodies around it, else the main one.
        Those of `tag` in the class count, which is by default the tag of the element.
        """
        name = element.attributes.get("class", childclass or self.main_class)
        if name not in self.defaults:
            raise self.reading.error(
                element, f"no <default> has the class {shown(name)}{nearest(name, self.defaults)}"
            )
        given = self.defaults[name].get(tag or element.tag, {})
        if not given:
            return element
        own = element.attributes
        if any(each in own for each in _ORIENTATIONS):
            given = {name: value for name, value in given.items() if name not in _ORIENTATIONS}
        return self.reading.like(element, {**given, **own})

    def is_limited(self, element: Element, limited: str, limits: str, what: str) -> bool:
        """Check whether a range is stated and acts. Raises DescriptionError where ``limited`` demands one,
        and where only ``autolimits`` could say."""
        choice = self.reading.choice(element, limited, what, ("auto", "true", "false"), "auto")
        given = limits in element.attributes
        if choice == "true" and not given:
            raise self.reading.error(element, f'{what} has {limited}="true" and no {limits}')
        if choice == "auto" and given and not self.compiler_of(element).autolimits:
            raise self.reading.error(
                element, f'{what} has {limits} and not {limited}, which autolimits="false" demands'
            )
        return given and choice != "false"

    def pose(self, element: Element, what: str) -> Floats:
        """Return the pose (4, 4) of ``pos`` and of the orientation of an element."""
        position = np.zeros(3)
        if "pos" in element.attributes:
            position = np.array(self.reading.vector(element, "pos", what))
        return homogeneous(self.rotation(element, what), position)

    def rotation(self, element: Element, what: str) -> Floats:
        """Return the rotation (3, 3) that the one attribute of orientation of an element states."""
        reading = self.reading
        given = [each for each in _ORIENTATIONS if each in element.attributes]
        if len(given) > 1:
            raise reading.error(
                element, f"{what} has {' and '.join(given)}; wanted one of them, since each is an orientation"
            )
        if not given:
            return np.eye(3)
        (kind,) = given
        if kind == "quat":
            w, x, y, z = _direction(reading.numbers(element, kind, what, 4), kind, element, what, reading)
            return np.asarray(rotation_from_quat(np.array([x, y, z, w])))
        if kind == "axisangle":
            *axis, angle = reading.numbers(element, kind, what, 4)
            unit = _direction(axis, kind, element, what, reading)
            return turn(unit, self.compiler_of(element).radians(angle))
        if kind == "euler":
            return self.compiler_of(element).euler(reading.vector(element, kind, what))
        if kind == "zaxis":
            return rotation_of_z(
                _direction(reading.vector(element, kind, what), kind, element, what, reading)
            )
        numbers = np.array(reading.numbers(element, kind, what, 6))
        x_axis = _direction(numbers[:3], kind, element, what, reading)
        y_axis = _direction(numbers[3:] - x_axis * (x_axis @ numbers[3:]), kind, element, what, reading)
        return np.stack([x_axis, y_axis, np.cross(x_axis, y_axis)], axis=1)

    def find(self, element: Element, folder: str, filename: str) -> tuple[str, str]:
        """Return the path of an asset of an element as `find_mesh` finds it; else the name in the file, and
        the reason."""
        origin = self.origin(element)
        name, source = origin.compiler.path(folder, filename), origin.source
        try:
            found = find_mesh(name, source, self.package_dirs)
        except MeshNotFoundError as error:
            return name, str(error)
        return (name, reason_unknown(name, source)) if found is None else (str(found), "")


def turn(axis: Floats, angle: float) -> Floats:
    """Return the rotation (3, 3) by an angle [rad] about a unit axis (3,)."""
    return np.asarray(rotation_about(axis, np.asarray(angle)))


def _direction(numbers: Iterable[float], kind: str, element: Element, what: str, reading: Reading) -> Floats:
    vector = np.array(tuple(numbers))
    largest = float(np.max(np.abs(vector)))
    if largest < _SHORTEST:
        raise reading.error(element, f"{kind} of {what} is zero; wanted a direction")
    vector = vector / largest
    return np.asarray(vector / np.linalg.norm(vector))


def require_classes(
    tree: Element, defaults: dict[str, dict[str, dict[str, str]]], reading: MjcfReading
) -> None:
    """Raise DescriptionError where a body names a class that no ``<default>`` has."""
    waiting = [tree]
    while waiting:
        element = waiting.pop()
        name = element.attributes.get("childclass")
        if name is not None and name not in defaults:
            raise reading.error(
                element, f"no <default> has the class {shown(name)} of childclass{nearest(name, defaults)}"
            )
        waiting += reversed(element.children)


def require_bounded(root: Element, reading: MjcfReading) -> None:
    count, waiting = 0, [root]
    while waiting:
        count += 1
        each = waiting.pop()
        if count > MAX_ELEMENTS:
            raise reading.error(each, f"the model has more than {MAX_ELEMENTS} elements")
        waiting += each.children


class Includes:
    """Replaces each ``<include>`` by the content of its file."""

    def __init__(self, reading: MjcfReading, package_dirs: tuple[str, ...], source: str) -> None:
        """`source` is the file of the model."""
        self._reading, self._package_dirs, self._source = reading, package_dirs, source
        self._read: set[str] = set()

    def expand(self, element: Element, depth: int = 0) -> None:
        if not any(child.tag == "include" for child in element.children):
            for child in element.children:
                self.expand(child, depth + 1)
            return
        children: list[Element] = []
        for child in element.children:
            if child.tag == "include":
                included = self._content(child, depth)
                self.expand(included, depth + 1)
                children += included.children
            else:
                self.expand(child, depth + 1)
                children.append(child)
        element.children = children

    def _content(self, include: Element, depth: int) -> Element:
        reading = self._reading
        filename = reading.attribute(include, "file", "<include>")
        reading.count_included(include, depth)
        try:
            path = find_mesh(filename, self._source, self._package_dirs)
            reason = None if path else reason_unknown(filename, self._source)
        except MeshNotFoundError as error:
            path, reason = None, str(error)
        if path is None:
            raise reading.error(include, f"the file {shown(filename, 200)} is not included: {reason}")
        if str(path) in self._read:
            raise reading.error(include, f"the file {shown(filename, 200)} is included twice")
        self._read.add(str(path))
        return reading.read_included(str(path))


_WORDS = {
    "eulerseq": "euler_sequence",
    "inertiafromgeom": "inertia_from_geom",
    "meshdir": "mesh_folder",
    "texturedir": "texture_folder",
}


def read_compiler(root: Element, reading: MjcfReading) -> Compiler:
    values: dict[str, Any] = {}
    what = "<compiler>"
    for element in root.all("compiler"):
        given = element.attributes
        if reading.choice(element, "coordinate", what, ("local", "global"), "local") == "global":
            raise reading.unsupported(element, 'coordinate="global" is no longer part of MJCF')
        reading.choice(element, "angle", what, ("degree", "radian"), "degree")
        reading.choice(element, "inertiafromgeom", what, ("false", "true", "auto"), "auto")
        sequence = given.get("eulerseq", "xyz")
        if len(sequence) != 3 or set(sequence.lower()) - set("xyz"):
            raise reading.error(element, f"eulerseq is {shown(sequence)}; wanted three letters of xyzXYZ")
        if "assetdir" in given:
            values["mesh_folder"] = values["texture_folder"] = given["assetdir"]
        if "angle" in given:
            values["degrees"] = given["angle"] == "degree"
        values |= {name: given[each] for each, name in _WORDS.items() if each in given}
        for attribute, name in (
            ("alignfree", "align_free"),
            ("fitaabb", "fit_bounding_box"),
            ("autolimits", "autolimits"),
            ("balanceinertia", "balance_inertia"),
            ("strippath", "strip_path"),
        ):
            if attribute in given:
                values[name] = reading.flag(element, attribute, what, default=False)
        for attribute, name in (
            ("boundmass", "bound_mass"),
            ("boundinertia", "bound_inertia"),
            ("settotalmass", "total_mass"),
        ):
            if attribute in given:
                values[name] = reading.number(element, attribute, what)
        if "inertiagrouprange" in given:
            values["inertia_groups"] = reading.numbers(element, "inertiagrouprange", what, 2)
    return Compiler(**values)


def read_defaults(root: Element, reading: MjcfReading) -> tuple[dict[str, dict[str, dict[str, str]]], str]:
    """Return the attributes of each class and tag, with those of the classes around, and the main class."""
    classes: dict[str, dict[str, dict[str, str]]] = {}
    tops = root.all("default")
    main_class = tops[0].attributes.get("class", "main") if tops else "main"
    waiting: list[tuple[Element, str | None]] = [(each, None) for each in reversed(tops)]
    while waiting:
        element, parent = waiting.pop()
        name = element.attributes.get("class", main_class if parent is None else None)
        if name is None:
            raise reading.error(element, 'a <default> inside another one has no class; wanted class="..."')
        if name in classes and not (parent is None and name == main_class):
            raise reading.error(element, f"the class {shown(name)} of <default> is defined twice")
        inherited = classes.get(name) or classes.get(parent or "", {})
        own = {tag: dict(attributes) for tag, attributes in inherited.items()}
        for child in element.children:
            if child.tag in WITH_DEFAULTS or child.tag in ACTUATORS:
                given = dict(own.get(child.tag, {}))
                if any(each in child.attributes for each in _ORIENTATIONS):
                    given = {key: value for key, value in given.items() if key not in _ORIENTATIONS}
                own[child.tag] = {**given, **child.attributes}
        classes[name] = own
        waiting += [(child, name) for child in reversed(element.all("default"))]
    classes.setdefault(main_class, {})
    return classes, main_class


def stem(path: str) -> str:
    """Return the name of a file without its folder and suffix, as MuJoCo names assets without a name."""
    return path.rpartition("/")[2].rpartition(".")[0]
