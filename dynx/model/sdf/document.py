"""SDF text as scopes: worlds and models with their links, joints and frames, and the files included.

The format is that of versions 1.4 to 1.12 (http://sdformat.org/spec). A *scope* is a world or a model, in
which names are unique; ``a::b`` is the part b of the model a in it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Literal

from dynx.errors import escaped, nearest, shown
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh, reason_unknown
from dynx.model.package_search import MODEL_MANIFEST, StrPath
from dynx.model.sdf.vocabulary import (
    ATTRIBUTES,
    ATTRIBUTES_NOT_USED,
    CLOSED,
    NOT_USED,
    OPAQUE,
    TEXTS,
    USED,
)
from dynx.model.topology import MAX_LINKS
from dynx.model.xml.reading import MAX_DEPTH, MAX_ELEMENTS, Element, read_xml
from dynx.model.xml.several_files import FilesReading
from dynx.model.xml.values import name_fault

Version = tuple[int, int]
Kind = Literal["link", "joint", "frame"]

OLDEST, NEWEST = (1, 4), (1, 12)
"""Versions of SDF that are read."""

MAX_PARTS = 10 * MAX_LINKS
"""Largest number of links, joints, frames and shapes, in included models each time they are included."""

MODEL_FRAME, WORLD = "__model__", "world"

ONE_ROBOT = (
    "a Model is one robot: give each a file of its own, which a scene of dynx.world.read_scene can name"
)

_OF_WORLD = (
    ": PyBullet alone reads such a link, as the base; give it another name, here and in the joints that "
    "name it, or, if it stands still and has no shape, remove it; its joints then connect to the world"
)

_VERSION = re.compile(r"\s*([0-9]{1,3})\.([0-9]{1,3})(?:\.[0-9]+)?\s*")
_TRUE, _FALSE = ("true", "1"), ("false", "0")
_FILES = (".sdf", ".world", ".xml", ".urdf")
_BARE_NAME = re.compile(r"[^/\\:$]+")
_REMOTE = re.compile("https?://|fuel://", re.IGNORECASE)


@dataclass
class SdfReading(FilesReading):
    """State of reading a model in SDF: its elements hold their values as text."""

    unread: dict[tuple[str, str, str], tuple[Element, int, str]] = field(default_factory=dict)
    """First of the elements or attributes that are not used, their number and what it means, by the file, the
    element around and the name."""

    included_files: dict[str, int] = field(default_factory=dict)
    """Line in the document that leads to an included file, the first of them, by the path of the file."""

    def one(self, parent: Element, tag: str, what: str) -> Element | None:
        """Return the element of that tag with its text as an attribute of that name, or None."""
        found = self.only(parent, tag)
        if found is None:
            return None
        # As an attribute, so that the readers of attributes read it and name it in their errors.
        at = Element(parent.tag, {tag: found.text.strip()}, found.line)
        held = self.files.get(id(found))
        if held is not None:
            self.files[id(at)] = (at, held[1])
        if not at.attributes[tag]:
            raise self.error(at, f"<{tag}> in <{parent.tag}> of {what} is empty")
        return at

    def scalar(self, parent: Element, tag: str, what: str, default: float) -> float:
        """Return the finite number in the element of that tag."""
        found = self.one(parent, tag, what)
        return default if found is None else self.number(found, tag, what)

    def word(self, parent: Element, tag: str, what: str) -> str | None:
        """Return the text in the element of that tag, or None."""
        found = self.one(parent, tag, what)
        return None if found is None else found.attributes[tag]

    def truth(self, parent: Element, tag: str, what: str, default: bool) -> bool:
        """Return whether the element of that tag is true."""
        found = self.one(parent, tag, what)
        return default if found is None else self.flag(found, tag, what, default)

    def flag(self, element: Element, attribute: str, what: str, default: bool) -> bool:
        """Return an attribute that is true or false, or 1 or 0."""
        value = element.attributes.get(attribute, str(default)).strip().lower()
        if value not in _TRUE + _FALSE:
            raise self.error(
                element, f"{attribute} of {what} is {shown(value)}; wanted true or false, or 1 or 0"
            )
        return value in _TRUE

    def leave_unread(self, element: Element, around: str, name: str, effect: str) -> None:
        """Count an element or attribute that is not used, for one note per kind."""
        key = (self.source_of(element), around, name)
        first, count, _ = self.unread.get(key, (element, 0, ""))
        self.unread[key] = (first, count + 1, effect)

    def note_unread(self) -> None:
        """Convert the counts of `leave_unread` to notes."""
        for (_, around, name), (element, count, effect) in self.unread.items():
            times = "" if count == 1 else f" ({count} times)"
            self.note(element, f"{escaped(name)} of <{around}> is not read{times}: {effect}")


@dataclass
class NamedPart:
    """A link, joint or frame of a scope."""

    kind: Kind
    name: str
    element: Element
    scope: Scope

    @property
    def what(self) -> str:
        """Name of the part in errors."""
        return f"{self.kind} {shown(self.name)}"


@dataclass
class Scope:
    """A world, or a model: its parts and the models in it, in the order of the document.

    `pose` is the element that places it in the scope around, `placement_frame` the frame in it that is placed
    so. The parts of `merged` models are named as those of this one.
    """

    element: Element
    name: str
    parent: Scope | None
    version: Version
    pose: Element | None = None
    placement_frame: str = ""
    static: bool = False
    content: list[NamedPart | Scope] = field(default_factory=list)
    merged: bool = False
    parts: dict[str, NamedPart] = field(default_factory=dict)
    models: dict[str, Scope] = field(default_factory=dict)
    merged_names: dict[str, NamedPart | Scope] = field(default_factory=dict)
    """Parts and models of the merged models, by their names in this scope."""

    @property
    def is_world(self) -> bool:
        """True for a world, which has no pose."""
        return self.element.tag == "world"

    @property
    def what(self) -> str:
        """Name of the scope in errors."""
        return f"{'world' if self.is_world else 'model'} {shown(self.name)}"

    def walk(self) -> Iterator[NamedPart]:
        """Yield the parts of this scope and of those in it, in the order of the document."""
        stack: list[NamedPart | Scope] = [self]
        while stack:
            each = stack.pop()
            if isinstance(each, NamedPart):
                yield each
            else:
                stack += reversed(each.content)

    def names(self) -> list[str]:
        """Return the names that may be referred to in this scope."""
        return [*self.parts, *self.models, *self.merged_names]

    def find(self, name: str) -> NamedPart | Scope | None:
        """Return the part or model of that name, also one of a merged model; None if there is none."""
        found = self.parts.get(name) or self.models.get(name) or self.merged_names.get(name)
        if found is not None:
            return found
        first, _, rest = name.partition("::")
        inner = self.find(first) if rest else None
        if not isinstance(inner, Scope):
            return None
        return inner if rest == MODEL_FRAME else inner.find(rest)


def is_reserved(name: str) -> bool:
    """Check whether the format keeps a name for itself."""
    return name == WORLD or (name.startswith("__") and name.endswith("__"))


def version_of(text: str) -> Version:
    """Return the version of SDF that a text states; (0, 0) for another text."""
    found = _VERSION.fullmatch(text)
    return (int(found[1]), int(found[2])) if found else (0, 0)


def read_document(
    data: str | bytes, source: str, package_dirs: Iterable[StrPath]
) -> tuple[Scope, SdfReading] | None:
    """Read the world or model of SDF text, with the models that it includes; None for another document.

    Files are included from the folder of the files of the one that includes them, and from packages
    (`find_mesh`). Raises DescriptionError for malformed content.
    """
    reading = SdfReading(source)
    root = read_xml(data, source, reading.notes, opaque=OPAQUE, with_text=TEXTS)
    if root.tag != "sdf":
        return None
    return _ScopeReader(reading, tuple(map(str, package_dirs))).read(root), reading


def included_files(data: str | bytes, source: str) -> dict[str, int]:
    """Return the paths of the files that a document in SDF includes, also of those that these include, each
    with the first line in the document that leads to it. Raises the errors of `read_document`."""
    found = read_document(data, source, ())
    return {} if found is None else found[1].included_files


class _ScopeReader:
    """Reads scopes; `open_files` are those that are being included, in a row."""

    def __init__(self, reading: SdfReading, package_dirs: tuple[str, ...]) -> None:
        self._reading, self._package_dirs = reading, package_dirs
        self._open_files: list[str] = []
        self._outer_line = 0
        self._roots: dict[str, Element] = {}
        self._sizes: dict[str, int] = {}
        self._elements = 0
        self._links = 0
        self._parts = 0

    def read(self, root: Element) -> Scope:
        version = self._checked(root)
        reading = self._reading
        worlds, models = root.all("world"), _models_of(root)
        if len(worlds) + len(models) > 1:
            second = (worlds + models)[1]
            raise reading.unsupported(
                second,
                f"the file holds {len(worlds)} worlds and {len(models)} models; {ONE_ROBOT}",
            )
        if not worlds and not models:
            raise reading.error(root, "<sdf> has neither a <model> nor a <world>; wanted one")
        return self._scope(worlds[0], None, version) if worlds else self._model(models[0], None, version)

    def _checked(self, root: Element) -> Version:
        """Return the version of a document; raise an error for an element or attribute that it has not."""
        reading = self._reading
        text = reading.attribute(root, "version", "the file")
        version = version_of(text)
        if not OLDEST <= version <= NEWEST:
            raise reading.unsupported(
                root, f"the version of SDF is {shown(text)}; dynx reads 1.{OLDEST[1]} to 1.{NEWEST[1]}"
            )
        waiting = [root]
        while waiting:
            each = waiting.pop()
            if each.tag in CLOSED:
                continue
            self._check_attributes(each)
            if version >= (1, 7):
                self._refuse_renamed(each)
            if each.tag not in USED:
                continue
            self._check_children(each)
            used = USED[each.tag].split()
            waiting += [child for child in each.children if child.tag in used]
        return version

    def _refuse_renamed(self, element: Element) -> None:
        """Raise DescriptionError for what version 1.7 gave another name, and programs ignore since."""
        if element.tag == "pose" and "frame" in element.attributes:
            raise self._reading.error(element, "frame of <pose> is called relative_to since version 1.7")
        for child in element.all("use_parent_model_frame"):
            axes = element.all("xyz")
            if child.text.strip() in _FALSE or (axes and "expressed_in" in axes[0].attributes):
                effect = "it is no element since version 1.7, and programs ignore it"
                self._reading.leave_unread(child, element.tag, "<use_parent_model_frame>", effect)
                continue
            raise self._reading.error(
                child,
                f"<use_parent_model_frame> of <{element.tag}> is no element since version 1.7; "
                'wanted <xyz expressed_in="__model__">',
            )

    def _check_children(self, element: Element) -> None:
        used, left = USED[element.tag].split(), NOT_USED.get(element.tag, {})
        for child in element.children:
            if child.tag == "physics" and element.tag == "world":
                effect = "it sets up an engine, but for its gravity before version 1.6"
                self._reading.leave_unread(child, element.tag, "<physics>", effect)
            elif child.tag in used:
                continue
            elif child.tag == "plugin":
                self._reading.leave_unread(
                    child, element.tag, "<plugin>", "the forces of a plug-in do not act"
                )
            elif child.tag in left:
                self._reading.leave_unread(child, element.tag, f"<{child.tag}>", left[child.tag])
            elif ":" in child.tag:
                effect = "it is of one program"
                self._reading.leave_unread(child, element.tag, f"<{child.tag}>", effect)
            else:
                raise self._reading.error(
                    child,
                    f"<{escaped(element.tag)}> has the unknown element <{escaped(child.tag)}>"
                    f"{nearest(child.tag, [*used, *left])}",
                )

    def _check_attributes(self, element: Element) -> None:
        used = ATTRIBUTES.get(element.tag, "").split()
        left = ATTRIBUTES_NOT_USED.get(element.tag, {})
        for attribute in element.attributes:
            if attribute.partition(":")[0] == "xmlns" or attribute in used:
                continue
            effect = left.get(attribute, "it is of one program" if ":" in attribute else "")
            if effect:
                self._reading.leave_unread(element, element.tag, attribute, effect)
            else:
                self._reading.require_known_attributes(element, [*used, *left])

    # -- scopes ---------------------------------------------------------------------------------

    def _scope(self, element: Element, parent: Scope | None, version: Version) -> Scope:
        """Read a world or model."""
        reading = self._reading
        name = reading.name(element, "name", f"a <{element.tag}>")
        scope = Scope(element, name, parent, version)
        if element.tag == "model":
            scope.pose = reading.only(element, "pose")
            scope.placement_frame = element.attributes.get("placement_frame", "")
            scope.static = reading.truth(element, "static", scope.what, default=False)
        if len(self._parents(scope)) > MAX_DEPTH // 4:
            raise reading.error(element, f"more than {MAX_DEPTH // 4} models are nested")
        for child in element.children:
            if child.tag in ("link", "joint", "frame"):
                self._add_part(scope, child)
            elif child.tag == "model" or (child.tag == "include" and not self._is_absent_scenery(child)):
                self._add_model(scope, self._model(child, scope, version))
        return scope

    def _model(self, element: Element, parent: Scope | None, version: Version) -> Scope:
        """Read a <model>, or the model that an <include> names."""
        if element.tag == "include":
            return self._included(element, parent)
        return self._scope(element, parent, version)

    @staticmethod
    def _parents(scope: Scope) -> list[Scope]:
        found, each = [], scope.parent
        while each is not None:
            found.append(each)
            each = each.parent
        return found

    def _add_part(self, scope: Scope, element: Element) -> None:
        reading = self._reading
        name = reading.name(element, "name", f"a <{element.tag}>")
        kind: Kind = "link" if element.tag == "link" else "joint" if element.tag == "joint" else "frame"
        part = NamedPart(kind, name, element, scope)
        self._parts += 1 + len(element.all("visual")) + len(element.all("collision"))
        if self._parts > MAX_PARTS:
            raise reading.error(
                element, f"the file has more than {MAX_PARTS} links, joints, frames and shapes"
            )
        if is_reserved(name) and (kind == "link" or scope.version >= (1, 7)):
            remedy = _OF_WORLD if kind == "link" and name == WORLD else ""
            raise reading.error(element, f"{part.what} has a name that the format keeps for itself{remedy}")
        other = scope.parts.get(name) or scope.models.get(name)
        if isinstance(other, NamedPart) and (other.kind == kind or scope.version >= (1, 7)):
            raise reading.error(
                element, f"{part.what} has the name of a {other.kind} in line {other.element.line}"
            )
        if kind == "link":
            self._links += 1
            if self._links > MAX_LINKS:
                raise reading.error(element, f"the file has more than {MAX_LINKS} links")
        if other is None or kind == "link":  # Before 1.7 a joint may have the name of a link.
            scope.parts[name] = part
        scope.content.append(part)

    def _add_model(self, scope: Scope, model: Scope) -> None:
        if not model.merged:
            if model.name in scope.models or (model.name in scope.parts and scope.version >= (1, 7)):
                raise self._reading.error(
                    model.element, f"{scope.what} has two parts with the name {shown(model.name)}"
                )
            scope.models[model.name] = model
        else:
            inside = {**model.merged_names, **model.models, **model.parts}
            for name in inside:
                if scope.find(name) is not None:
                    raise self._reading.error(
                        model.element,
                        f"the merged {model.what} has a part {shown(name)}, and so has {scope.what}",
                    )
            scope.merged_names |= inside
        scope.content.append(model)

    # -- included files -------------------------------------------------------------------------

    def _is_absent_scenery(self, include: Element) -> bool:
        """Check whether an include names the sun or the ground of Gazebo, which moves nothing, and which is
        not there; note that it is not read."""
        uri = self._reading.word(include, "uri", "an <include>") or ""
        scenery = scenery_of(uri)
        if scenery is None:
            return False
        try:
            find_file(self._reading, include, f"{uri.rstrip('/')}/{MODEL_MANIFEST}", self._package_dirs)
        except MeshNotFoundError:
            self._reading.note(include, f"{shown(uri, 200)} was not found and is not read: {scenery}")
            return True
        return False

    def _included(self, include: Element, parent: Scope | None) -> Scope:
        reading = self._reading
        uri = reading.word(include, "uri", "an <include>")
        if uri is None:
            raise reading.error(include, "an <include> has no <uri>")
        what = f"the model {shown(uri, 200)}"
        path = self._file_of(include, uri)
        if not self._open_files:
            self._outer_line = include.line
        reading.included_files.setdefault(path, self._outer_line)
        if path in self._open_files:
            raise reading.error(include, f"{what} includes itself")
        reading.count_included(include, len(self._open_files))
        root = self._roots.get(path)
        if root is None:
            root = self._roots[path] = reading.read_included(path, opaque=OPAQUE, with_text=TEXTS)
            self._sizes[path] = sum(1 for _ in _walk(root))
            if root.tag != "sdf":
                raise reading.unsupported(
                    include, f"{what} has the root <{escaped(root.tag)}>; dynx includes SDF alone"
                )
            self._checked(root)
        self._elements += self._sizes[path]  # Each time: a file may be included often.
        if self._elements > MAX_ELEMENTS:
            raise reading.error(include, f"the included files have more than {MAX_ELEMENTS} elements")
        models = _models_of(root)
        if len(models) != 1 or root.all("world"):
            raise reading.error(
                include, f"{what} is a file of {len(models)} models; wanted one, and no world"
            )
        self._open_files.append(path)
        found = self._model(models[0], parent, self._version(root))
        self._open_files.pop()
        found.name = reading.word(include, "name", what) or found.name
        fault = name_fault(found.name)
        if fault is not None:
            raise reading.error(include, f"the name of {what} {fault}")
        pose = reading.only(include, "pose")
        placement = reading.word(include, "placement_frame", what) if include.all("placement_frame") else None
        if placement is not None:
            if pose is None:
                raise reading.error(include, f"{what} has a <placement_frame> and no <pose>")
            found.placement_frame = placement
        found.pose = found.pose if pose is None else pose
        found.static = reading.truth(include, "static", what, default=found.static)
        found.merged = reading.flag(include, "merge", what, default=False)
        return found

    @staticmethod
    def _version(root: Element) -> Version:
        found = _VERSION.fullmatch(root.attributes["version"])
        return (int(found[1]), int(found[2])) if found else OLDEST

    def _file_of(self, include: Element, uri: str) -> str:
        """Return the file that a URI names; a folder names it in its manifest."""
        if not uri.lower().endswith(_FILES):
            folder = self._model_folder(include, uri.rstrip("/"))
            manifest = self._find(include, f"{folder}/{MODEL_MANIFEST}", uri)
            root = self._reading.read_included(manifest, with_text=("sdf",))
            files = sorted(
                (found, each.text.strip())
                for each in root.all("sdf")
                if (found := version_of(each.attributes.get("version", ""))) <= NEWEST
            )
            if not files:
                raise self._reading.error(root, f"names no <sdf> of a version up to 1.{NEWEST[1]}")
            uri = f"{folder}/{files[-1][1]}"
        return self._find(include, uri, uri)

    def _model_folder(self, include: Element, folder: str) -> str:
        """Return the URI of the folder of a model; a bare name that is no folder beside the file is searched
        for as ``model://`` is, which Gazebo does."""
        if _BARE_NAME.fullmatch(folder):
            for uri in (folder, f"model://{folder}"):
                with suppress(MeshNotFoundError):
                    find_file(self._reading, include, f"{uri}/{MODEL_MANIFEST}", self._package_dirs)
                    return uri
        return folder

    def _find(self, include: Element, name: str, uri: str) -> str:
        try:
            return find_file(self._reading, include, name, self._package_dirs)
        except MeshNotFoundError as error:
            raise self._reading.error(include, f"{shown(uri, 200)} is not included: {error}") from None


_SCENERY = re.compile(r"(?:model://|https?://\S+/models/)(?:(sun)|ground(?:_| |%20)plane)/?", re.IGNORECASE)


def scenery_of(uri: str) -> str | None:
    """Describe the light or the ground of most worlds, which Gazebo brings along, where a URI names it; None
    for any other model."""
    found = _SCENERY.fullmatch(uri)
    if found is None:
        return None
    return (
        "a light of Gazebo"
        if found[1]
        else "a plane of Gazebo that does not move; the floor is that of the scene"
    )


def find_file(reading: SdfReading, element: Element, uri: str, package_dirs: Iterable[StrPath]) -> str:
    """Return the path of a file that an element names; raise MeshNotFoundError with the reason otherwise."""
    if _REMOTE.match(uri):
        raise MeshNotFoundError("dynx reads nothing from the network; name a file")
    source = reading.source_of(element)
    name = uri
    if name.startswith("file://") and not name.startswith("file:///"):
        name = name.removeprefix("file://")
    found = find_mesh(name, source, package_dirs)
    if found is None:
        raise MeshNotFoundError(reason_unknown(name, source))
    return str(found)


def _models_of(root: Element) -> list[Element]:
    """Return the models of a file: those in it, and those that it includes without a world around them."""
    return [child for child in root.children if child.tag in ("model", "include")]


def _walk(root: Element) -> Iterator[Element]:
    stack = [root]
    while stack:
        each = stack.pop()
        yield each
        stack += each.children
