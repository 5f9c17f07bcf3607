"""MJCF text as one document: files included, other models attached, defaults known, copies made.

An attached model (``<attach>``, MuJoCo's XML reference and its `mjs_attach`) is copied with its assets and
classes of defaults under names with the prefix, and keeps the settings of its own ``<compiler>``. Elements of
other sections come along where all that they refer to is attached. Options stay those of the model around.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from dynx.errors import nearest, shown
from dynx.model.elements import Note
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh, reason_unknown
from dynx.model.mjcf.document import (
    ATTRIBUTES,
    WITH_CONTENT_OF_THEIR_OWN,
    WITH_DEFAULTS,
    Includes,
    MjcfReading,
    MjcfText,
    Origin,
    read_compiler,
    read_defaults,
    require_bounded,
    require_classes,
    stem,
)
from dynx.model.mjcf.extension import MIMIC, PREFIX
from dynx.model.mjcf.options import read_options
from dynx.model.package_search import StrPath
from dynx.model.topology import MAX_LINKS
from dynx.model.xml.reading import MAX_DEPTH, Element, read_xml
from dynx.spatial.so3 import quat_from_rotation


def read_document(data: str | bytes, source: str, package_dirs: Iterable[StrPath] = ()) -> MjcfText | None:
    """Read a model in MJCF, with the files that it includes and the models that it attaches; None for a
    document of another kind.

    Files are read from the folder of the model's files alone, as meshes are (`find_mesh`). Raises
    DescriptionError for malformed content.
    """
    notes: list[Note] = []
    reading = MjcfReading(source, notes)
    root = read_xml(data, source, notes)
    if root.tag != "mujoco":
        return None
    return _document(root, source, reading, tuple(map(str, package_dirs)), ())


def _document(
    root: Element, source: str, reading: MjcfReading, folders: tuple[str, ...], around: tuple[str, ...]
) -> MjcfText:
    """Return the document of a root element; `around` are the files of the models that attach it."""
    Includes(reading, folders, source).expand(root)
    require_bounded(root, reading)
    for tag in ("compiler", "default", "worldbody", "keyframe"):
        for section in root.all(tag):
            waiting = [section]
            while waiting:
                each = waiting.pop()
                reading.require_known_attributes(each, ATTRIBUTES.get(each.tag, each.attributes))
                # Those of elements that are refused as a whole are not judged.
                waiting += [] if each.tag in WITH_CONTENT_OF_THEIR_OWN else each.children
    compiler = read_compiler(root, reading)
    defaults, main_class = read_defaults(root, reading)
    for tree in root.all("worldbody"):
        require_classes(tree, defaults, reading)
    options = read_options(root, reading)
    document = MjcfText(root, compiler, defaults, main_class, reading, options, folders)
    attacher = _Attacher(document, source, around)
    attacher.expand()
    copies = _Replicates(document)
    for tree in root.all("worldbody"):
        copies.expand(tree)
    return document


# -- attached models --------------------------------------------------------------------------------------

_SECTIONS = ("tendon", "contact", "equality", "actuator", "sensor")
"""Sections whose elements refer to parts of bodies or to elements of sections before them."""

_WITH_CLASSES = ("tendon", "equality", "actuator")
"""Sections whose elements take attributes from a class of defaults."""

_REFERENCES = {
    "body": ("body", "body1", "body2", "bodyname", "subtree1", "subtree2"),
    "camera": ("camera",),
    "joint": ("joint", "joint1", "joint2", "jointinparent"),
    "geom": ("geom", "geom1", "geom2"),
    "site": ("site", "site1", "site2", "refsite", "cranksite", "slidersite", "sidesite"),
    "tendon": ("tendon", "tendon1", "tendon2"),
    "actuator": ("actuator",),
    "any": ("objname", "refname"),
}
"""Attributes of elements of `_SECTIONS` by the kind of element that they name."""

_KIND_OF = {attribute: kind for kind, attributes in _REFERENCES.items() for attribute in attributes}

_TO_WORLD = ("refname", "world")
"""Reference of a sensor that is that to the world of the model around, as in MuJoCo."""

_OF_ASSETS = frozenset(["class", "childclass", "mesh", "material", "texture", "hfield"])
"""Attributes that name a class of defaults or an asset."""

_NAMED_BY_FILES = frozenset(["mesh", "hfield", "texture"])
"""Assets that have the name of their file where they state none."""

_KINDS = {"freejoint": "joint"}


class _NamesByKind:
    """Names of the elements of subtrees and sections, by kind."""

    def __init__(self) -> None:
        self._names: dict[str, set[str]] = {}

    def add(self, element: Element, kind: str | None = None) -> None:
        """Add the names of an element and of those in it."""
        waiting = [element]
        while waiting:
            each = waiting.pop()
            waiting += each.children
            if "name" in each.attributes:
                found = kind or _KINDS.get(each.tag, each.tag)
                self._names.setdefault(found, set()).add(each.attributes["name"])

    def hold(self, element: Element, least: int = 0) -> bool:
        """Check whether all that an element refers to is among them, and that it refers to so much."""
        references = [*_references(element)]
        return len(references) >= least and all(self.hold_name(kind, name) for kind, name in references)

    def hold_any(self, element: Element) -> bool:
        """Check whether any of what an element refers to is among them."""
        return any(self.hold_name(kind, name) for kind, name in _references(element))

    def hold_name(self, kind: str, name: str) -> bool:
        """Check whether a name is among them; any kind of name for the kind ``any``."""
        kinds = self._names.values() if kind == "any" else [self._names.get(kind, ())]
        return any(name in names for names in kinds)


def _references(element: Element) -> Iterator[tuple[str, str]]:
    waiting = [element]
    while waiting:
        each = waiting.pop()
        waiting += each.children
        for attribute, value in each.attributes.items():
            if attribute in _KIND_OF and (attribute, value) != _TO_WORLD:
                yield _KIND_OF[attribute], value


@dataclass
class _Copier:
    """Copies elements of an attached model: names with a prefix, and settings of their own."""

    reading: MjcfReading
    prefix: str
    origin: Origin
    main_class: str | None = None
    """Main class of defaults of another model, whose assets and classes come along under names of their own;
    None for elements of the same model."""

    def copy(self, element: Element, depth: int = 0) -> Element:
        """Return a copy of an element and of those in it."""
        self.reading.count_copy(element, "<attach>")
        if depth > MAX_DEPTH:
            raise self.reading.error(element, f"attached models are more than {MAX_DEPTH} elements deep")
        attributes = {
            name: self._renamed(value) if self._is_name(name) and (name, value) != _TO_WORLD else value
            for name, value in element.attributes.items()
        }
        new = self.reading.like(element, attributes)
        if id(element) not in self.reading.origins:
            self.reading.origins[id(new)] = (new, self.origin)
        new.children = [self.copy(child, depth + 1) for child in element.children]
        return new

    def _is_name(self, attribute: str) -> bool:
        return (
            attribute == "name"
            or attribute in _KIND_OF
            or (self.main_class is not None and attribute in _OF_ASSETS)
        )

    def _renamed(self, value: str) -> str:
        if value.startswith(MIMIC):
            return f"{MIMIC}{self.prefix}{value.removeprefix(MIMIC)}"
        return f"{self.prefix}{value}"


@dataclass
class _Seen:
    """An element that may be attached by its name, and the class of defaults around it."""

    element: Element
    childclass: str | None
    finished: bool = False


@dataclass
class _Child:
    """A model that may be attached: its document, and the prefixes of copies of its assets."""

    document: MjcfText
    source: str
    prefixes: set[str] = field(default_factory=set)


class _Attacher:
    """Replaces each ``<attach>`` by what it attaches."""

    def __init__(self, document: MjcfText, source: str, around: tuple[str, ...]) -> None:
        """`around` are the files of the models that attach this one, in `source`."""
        self._document, self._reading = document, document.reading
        self._around = (*around, source)
        self._children: dict[str, _Child] = {}
        self._seen: dict[tuple[str, str], _Seen] = {}
        self._before: list[Element] = []
        self.sections: list[Element] = []
        """Sections of the elements that came along."""

    def expand(self) -> None:
        """Expand all bodies of the document. Raises DescriptionError for what cannot be attached."""
        root = self._document.root
        if not any(_has(tree, "attach") for tree in root.all("worldbody")):
            return
        for section in list(root.children):
            if section.tag == "asset":
                self._read_models(section)
            if section.tag == "worldbody":
                self._expand(section, section.attributes.get("childclass"))
            self._before.append(section)
        root.children += self.sections

    def _read_models(self, section: Element) -> None:
        for element in section.all("model"):
            reading = self._reading
            reading.require_known_attributes(element, ("name", "file", "content_type"))
            filename = reading.attribute(element, "file", "<model>")
            reading.count_included(element, len(self._around))
            try:
                path = find_mesh(filename, self._around[-1], self._document.package_dirs)
                reason = None if path else reason_unknown(filename, self._around[-1])
            except MeshNotFoundError as error:
                path, reason = None, str(error)
            if path is None:
                raise reading.error(element, f"the model {shown(filename, 200)} is not read: {reason}")
            if str(path) in self._around:
                raise reading.error(element, f"the model {shown(filename, 200)} attaches itself")
            root = reading.read_included(str(path))
            if root.tag != "mujoco":
                raise reading.error(element, f"the file {shown(filename, 200)} is no model in MJCF")
            child = _document(root, str(path), reading, self._document.package_dirs, self._around)
            name = element.attributes.get("name") or root.attributes.get("model", "")
            self._children[name] = _Child(child, str(path))

    def _expand(self, element: Element, childclass: str | None) -> None:
        children: list[Element] = []
        for child in element.children:
            if child.tag == "attach":
                children.append(self._attached(child, childclass))
                continue
            key = child.tag, child.attributes.get("name", "")
            seen = None
            if child.tag in ("body", "frame") and key[1]:
                seen = self._seen.setdefault(key, _Seen(child, childclass))
            self._expand(child, child.attributes.get("childclass", childclass))
            if seen is not None:
                seen.finished = True
            children.append(child)
        element.children = children

    def _attached(self, element: Element, childclass: str | None) -> Element:
        """Return a frame with what an ``<attach>`` attaches."""
        reading, given = self._reading, element.attributes
        prefix = reading.attribute(element, "prefix", "<attach>")
        named = [kind for kind in ("body", "frame") if kind in given]
        if len(named) > 1:
            raise reading.error(element, "<attach> has body and frame; wanted one of them")
        if "model" not in given:
            return self._attached_copy(element, prefix, named)
        if any(
            each.attributes.get("conflict", "warning") != "warning" for each in self._root.all("compiler")
        ):
            raise reading.unsupported(
                element,
                'dynx attaches models by conflict="warning" alone, which keeps the options of this one',
            )
        name = given["model"]
        if name not in self._children:
            raise reading.error(
                element, f"<attach> names the model {shown(name)}{nearest(name, self._children)}"
            )
        child = self._children[name]
        document = child.document
        content, around = document.root.all("worldbody"), document.main_class
        parts = [part for tree in content for part in tree.children]
        if named:
            found = _found(content, named[0], given[named[0]])
            if found is None:
                raise reading.error(
                    element, f"model {shown(name)} has no {named[0]} {shown(given[named[0]])} to attach"
                )
            parts, around = [found[0]], found[1] or around
        origin = Origin(document.compiler, child.source)
        copier = _Copier(reading, prefix, origin, document.main_class)
        self._bring(element, name, child, copier)
        self._refer(parts, document.root.children, copier)
        return self._frame(element, [copier.copy(part) for part in parts], f"{prefix}{around}")

    @property
    def _root(self) -> Element:
        return self._document.root

    def _attached_copy(self, element: Element, prefix: str, named: Sequence[str]) -> Element:
        """Return a frame with a copy of a part of the same model."""
        reading = self._reading
        if not named:
            raise reading.error(element, "<attach> without a model has no body and no frame; wanted one")
        (kind,) = named
        name = element.attributes[kind]
        seen = self._seen.get((kind, name))
        if seen is not None and not seen.finished:
            raise reading.unsupported(element, f"{kind} {shown(name)} attaches itself, as far as it is read")
        if seen is None:
            known = [each for of, each in self._seen if of == kind]
            raise reading.error(
                element, f"no {kind} {shown(name)} stands before <attach>{nearest(name, known)}"
            )
        origin = Origin(self._document.compiler, self._around[-1])
        copier = _Copier(reading, prefix, origin)
        self._refer([seen.element], self._before, copier)
        return self._frame(element, [copier.copy(seen.element)], seen.childclass or self._document.main_class)

    def _frame(self, element: Element, content: list[Element], childclass: str) -> Element:
        frame = self._reading.like(element, {"childclass": childclass})
        frame.tag, frame.children = "frame", content
        self._see(frame, None)
        return frame

    def _see(self, element: Element, childclass: str | None) -> None:
        """Note what is attached as parts that may be attached again."""
        for child in element.children:
            inner = element.attributes.get("childclass", childclass)
            if child.tag in ("body", "frame") and "name" in child.attributes:
                self._seen.setdefault(
                    (child.tag, child.attributes["name"]), _Seen(child, inner, finished=True)
                )
            self._see(child, inner)

    def _bring(self, element: Element, name: str, child: _Child, copier: _Copier) -> None:
        """Copy the classes, the assets and the statements of dynx of a model, once for each prefix."""
        if copier.prefix in child.prefixes:
            return
        first = not child.prefixes
        child.prefixes.add(copier.prefix)
        document, prefix, reading = child.document, copier.prefix, self._reading
        for given, values in document.defaults.items():
            if f"{prefix}{given}" in self._document.defaults:
                raise reading.error(
                    element, f"the class {shown(prefix + given)} of the attached model is defined twice"
                )
            self._document.defaults[f"{prefix}{given}"] = {
                tag: {
                    key: f"{prefix}{value}" if key in _OF_ASSETS else value
                    for key, value in attributes.items()
                }
                for tag, attributes in values.items()
            }
        assets = Element("asset", {}, element.line)
        for asset in document.sections("asset"):
            if asset.tag == "model":
                continue
            new = copier.copy(asset)
            if "name" not in asset.attributes and asset.tag in _NAMED_BY_FILES:
                new.attributes["name"] = f"{prefix}{stem(asset.attributes.get('file', ''))}"
            if asset.tag in WITH_DEFAULTS:
                new.attributes.setdefault("class", f"{prefix}{document.main_class}")
            assets.children.append(new)
        custom = Element("custom", {}, element.line)
        for stated in document.sections("custom"):
            kind, _, of = stated.attributes.get("name", "").removeprefix(PREFIX).partition(":")
            if stated.attributes.get("name", "").startswith(PREFIX) and of:
                new = reading.like(stated, {**stated.attributes, "name": f"{PREFIX}{kind}:{prefix}{of}"})
                if stated.tag == "text":
                    new.attributes["data"] = f"{prefix}{stated.attributes.get('data', '')}"
                custom.children.append(new)
        self.sections += [assets, custom]
        for tag, reason in (
            ("option", "as in MuJoCo, that of this model counts"),
            ("keyframe", "no configuration of it is read"),
        ):
            if first and any(each.children or each.attributes for each in document.root.all(tag)):
                reading.note(element, f"<{tag}> of the attached model {shown(name)} is not read: {reason}")

    def _refer(self, parts: Sequence[Element], sections: Sequence[Element], copier: _Copier) -> None:
        """Copy the elements of sections that refer to nothing but the parts of bodies that are attached."""
        names = _NamesByKind()
        for part in parts:
            names.add(part)
        for tag in _SECTIONS:
            copies = Element(tag, {}, parts[0].line if parts else 0)
            for section in sections:
                for each in section.children if section.tag == tag else ():
                    if names.hold(each, least=int(tag != "sensor")):
                        copies.children.append(copier.copy(each))
                        if copier.main_class is not None and tag in _WITH_CLASSES:
                            own = f"{copier.prefix}{copier.main_class}"
                            copies.children[-1].attributes.setdefault("class", own)
                        names.add(each, tag if tag in ("tendon", "actuator") else None)
            if copies.children:
                self.sections.append(copies)


def _found(content: Sequence[Element], kind: str, name: str) -> tuple[Element, str | None] | None:
    """Return a body or frame by its name, and the class of defaults around it."""
    waiting: list[tuple[Element, str | None]] = [(each, None) for each in reversed(content)]
    while waiting:
        each, childclass = waiting.pop()
        if each.tag == kind and each.attributes.get("name") == name:
            return each, childclass
        inner = each.attributes.get("childclass", childclass)
        waiting += [(child, inner) for child in reversed(each.children)]
    return None


def _has(element: Element, tag: str) -> bool:
    waiting = [element]
    while waiting:
        each = waiting.pop()
        if each.tag == tag:
            return True
        waiting += each.children
    return False


# -- copies -----------------------------------------------------------------------------------------------


def _suffixed(element: Element, suffix: str, names: _NamesByKind, reading: MjcfReading) -> Element:
    """Return a copy of an element of a section whose name, and references to `names`, have a suffix."""
    reading.count_copy(element, "<replicate>")
    attributes = {
        name: f"{value}{suffix}"
        if name == "name" or (name in _KIND_OF and names.hold_name(_KIND_OF[name], value))
        else value
        for name, value in element.attributes.items()
    }
    new = reading.like(element, attributes)
    new.children = [_suffixed(child, suffix, names, reading) for child in element.children]
    return new


class _Replicates:
    """Replaces each ``<replicate>`` by its copies, each in a ``<frame>``."""

    def __init__(self, document: MjcfText) -> None:
        self._document, self._reading = document, document.reading

    def expand(self, element: Element) -> None:
        for child in element.children:
            self.expand(child)
        if any(child.tag == "replicate" for child in element.children):
            element.children = [
                each
                for child in element.children
                for each in (self._copies(child) if child.tag == "replicate" else [child])
            ]

    def _copies(self, element: Element) -> list[Element]:
        reading, what = self._reading, "<replicate>"
        count = reading.number(element, "count", what)
        if count != int(count) or not 1 <= count <= MAX_LINKS:
            raise reading.error(
                element, f"count of {what} is {count:g}; wanted a whole number from 1 to {MAX_LINKS}"
            )
        angles, offset = (
            np.array(reading.vector(element, each, what) if each in element.attributes else (0.0, 0.0, 0.0))
            for each in ("euler", "offset")
        )
        if "prefix" in element.attributes:
            reading.note(element, f"prefix of {what} is not read: MuJoCo gives it no effect")
        separator = element.attributes.get("sep", "")
        digits = len(str(int(count)))
        position = np.zeros(3)
        found: list[Element] = []
        suffixes: list[str] = []
        for number in range(int(count)):
            # As MuJoCo does: the angles of copy k are k times those stated, whatever that turns about.
            R = self._document.compiler_of(element).euler(number * angles)
            x, y, z, w = quat_from_rotation(R)
            attributes = {
                "pos": " ".join(map(repr, position.tolist())),
                "quat": " ".join(map(repr, (float(w), float(x), float(y), float(z)))),
            }
            if "childclass" in element.attributes:
                attributes["childclass"] = element.attributes["childclass"]
            frame = Element("frame", attributes, element.line)
            suffix = f"{separator}{number:0{digits}d}"
            frame.children = [self._renamed(child, suffix) for child in element.children]
            found.append(frame)
            suffixes.append(suffix)
            position = position + R @ offset
        self._copy_referring(element, suffixes)
        return found

    def _copy_referring(self, element: Element, suffixes: Sequence[str]) -> None:
        """Replace the elements of sections that refer to what is copied by a copy each, at the end."""
        names = _NamesByKind()
        for child in element.children:
            names.add(child)
        for tag in _SECTIONS:
            for section in self._document.root.all(tag):
                # Constraints between a copy and another part stay as they are, as in MuJoCo.
                copied = [
                    names.hold(each, least=1) if tag == "equality" else names.hold_any(each)
                    for each in section.children
                ]
                referring = [each for each, yes in zip(section.children, copied, strict=True) if yes]
                others = [each for each, yes in zip(section.children, copied, strict=True) if not yes]
                copies = [
                    _suffixed(each, suffix, names, self._reading) for suffix in suffixes for each in referring
                ]
                section.children = [*others, *copies]
                for each in referring if tag in ("tendon", "actuator") else ():
                    names.add(each, tag)

    def _renamed(self, element: Element, suffix: str) -> Element:
        self._reading.count_copy(element, "<replicate>")
        attributes = dict(element.attributes)
        if "name" in attributes:
            attributes["name"] += suffix
        new = self._reading.like(element, attributes)
        new.children = [self._renamed(child, suffix) for child in element.children]
        return new
