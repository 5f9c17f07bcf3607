"""Attributes of MJCF that dynx does not use, by the elements that have them, and what follows.

A note names those with an effect in MuJoCo. The others draw something, organise the file, or are settings of
MuJoCo's program, and a robot is the same without them. An attribute that neither this table nor the reader
has is misspelt. Numbers that dynx does not read may have commas, with a note.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from dynx.errors import escaped, shown
from dynx.model.xml.reading import Element
from dynx.model.xml.values import DECIMAL

_NO_EFFECT = ""
_SOLVER = "they are parameters of MuJoCo's solver"
_CONTACT = "contacts have the parameters of the World"
_FLUID = "no fluid brakes"
_LOOKS = (
    "type builtin colorspace content_type embed file gridlayout gridsize height hflip mark markrgb nchannel"
)

NOT_USED: Mapping[str, Mapping[str, str]] = {
    "compiler": {
        _NO_EFFECT: "conflict discardvisual fusestatic passthrough savecanonical savecompiled saveinertial "
        "usethread"
    },
    "lengthrange": {
        _NO_EFFECT: "accel interval inttotal maxforce mode timeconst timestep tolrange useexisting uselimit"
    },
    "mesh": {
        "the convex hull has all vertices": "maxhullvert",
        _NO_EFFECT: "builtin content_type material normal params smoothnormal texcoord",
    },
    "hfield": {_NO_EFFECT: "content_type"},
    "texture": {
        _NO_EFFECT: f"class {_LOOKS} random rgb1 rgb2 vflip width fileback filedown filefront fileleft "
        "fileright fileup"
    },
    "material": {
        _NO_EFFECT: "emission metallic reflectance roughness shininess specular texrepeat texuniform"
    },
    "layer": {_NO_EFFECT: "role texture"},
    "body": {_NO_EFFECT: "fuse simple sleep user"},
    "joint": {
        _SOLVER: "margin solimpfriction solimplimit solreffriction solreflimit",
        "gravity compensation does not go through actuators": "actuatorgravcomp",
        _NO_EFFECT: "group user",
    },
    "freejoint": {_NO_EFFECT: "group"},
    "geom": {
        _CONTACT: "adhesion gap margin solimp solmix solref surfacevel",
        _FLUID: "fluidcoef fluidshape",
        _NO_EFFECT: "castshadow user",
    },
    "site": {_NO_EFFECT: "group material mesh rgba size type user"},
    "camera": {
        _NO_EFFECT: "axisangle class euler focal focalpixel fovy ipd mode output pos principal "
        "principalpixel projection quat resolution sensorsize target user xyaxes zaxis"
    },
    "light": {
        _NO_EFFECT: "active ambient attenuation bulbradius castshadow class cutoff diffuse dir directional "
        "exponent intensity mode pos range softness specular target texture type"
    },
    "pair": {_CONTACT: "adhesion class condim friction gap margin solimp solref solreffriction"},
    "tendon": {_NO_EFFECT: "group material rgba user width"},
    "fixed": {_NO_EFFECT: "group user"},
    "key": {_NO_EFFECT: "plastic"},
    "numeric": {_NO_EFFECT: "data size"},
    "text": {_NO_EFFECT: "data"},
    "element": {_NO_EFFECT: "objname objtype prm"},
}
"""Attributes by the tag of their element and by what follows; an empty text for those without an effect."""

OF_ACTUATORS = frozenset(["actearly", "actlimited", "actrange", "dynprm", "group", "lengthrange", "user"])
"""Attributes of actuators that dynx does not use: of actuators with a state, and without an effect."""

OF_SENSORS = frozenset(["interp", "user"])
"""Attributes of sensors that dynx does not use: of sensors with a delay, and without an effect."""

SECTIONS_WITHOUT_ROBOT = frozenset(["size", "statistic", "visual"])
"""Sections of which no attribute is used: memory, estimates and drawing of MuJoCo."""

_PLACES = ("default", "asset", "worldbody")
"""Sections whose elements have an attribute that a note names."""


def unused_attributes(root: Element) -> Iterator[tuple[Element, str]]:
    """Yield the attributes of a document that have an effect in MuJoCo and none in dynx, those of one kind of
    element together: the first element, and a sentence."""
    found: dict[tuple[str, str], tuple[Element, dict[str, None]]] = {}
    waiting = [section for tag in reversed(_PLACES) for section in reversed(root.all(tag))]
    while waiting:
        element = waiting.pop()
        waiting += reversed(element.children)
        for effect, names in NOT_USED.get(element.tag, {}).items():
            stated = [name for name in names.split() if name in element.attributes] if effect else []
            if stated:
                _, known = found.setdefault((element.tag, effect), (element, {}))
                known.update(dict.fromkeys(stated))
    for (tag, effect), (element, known) in found.items():
        yield element, f"not read of <{tag}>: {', '.join(known)}; {effect}"


# -- elements ---------------------------------------------------------------------------------------------

_MOTORS = (
    "general motor position velocity intvelocity orientation pid damper cylinder muscle adhesion dcmotor "
    "plugin"
)
_SENSORS = (
    "touch accelerometer velocimeter gyro force torque magnetometer camprojection rangefinder jointpos "
    "jointvel tendonpos tendonvel actuatorpos actuatorvel actuatorfrc jointactuatorfrc tendonactuatorfrc "
    "ballquat ballangvel jointlimitpos jointlimitvel jointlimitfrc tendonlimitpos tendonlimitvel "
    "tendonlimitfrc framepos framequat framexaxis frameyaxis framezaxis framelinvel frameangvel framelinacc "
    "frameangacc subtreecom subtreelinvel subtreeangmom insidesite distance normal fromto contact "
    "e_potential e_kinetic clock tactile user plugin"
)
_IN_BODY = (
    "body joint freejoint geom site inertial frame replicate attach camera light plugin composite flexcomp"
)
_IN_DEFAULT = "default mesh texture material joint geom site camera light pair equality tendon"
IN_SECTIONS: Mapping[str, str] = {
    "compiler": "lengthrange",
    "option": "flag",
    "size": "",
    "statistic": "",
    "visual": "global quality headlight map scale rgba",
    "default": f"{_IN_DEFAULT} {_MOTORS}",
    "asset": "mesh hfield skin texture material model",
    "contact": "pair exclude",
    "custom": "numeric text tuple",
    "tendon": "fixed spatial",
    "equality": "connect weld joint tendon flex flexvert flexstrain distance",
    "actuator": _MOTORS,
    "sensor": _SENSORS,
    "keyframe": "key",
    "worldbody": _IN_BODY,
}
"""Elements of each section; those of extensions and soft bodies are not looked into."""

IN_ELEMENTS: Mapping[str, str] = {
    "body": _IN_BODY,
    "frame": _IN_BODY,
    "replicate": _IN_BODY,
    "default": f"{_IN_DEFAULT} {_MOTORS}",
    "geom": "plugin",
    "mesh": "plugin",
    "material": "layer",
    "skin": "bone",
    "tuple": "element",
    "fixed": "joint",
    "spatial": "site geom pulley",
    "plugin": "config",
}
"""Elements inside of an element of a section, by its tag; others hold none."""

_WITHOUT_ATTRIBUTES = frozenset(
    ["visual", "asset", "contact", "custom", "tendon", "equality", "actuator", "sensor", "keyframe"]
)
"""Sections without attributes."""

_CLOSED = frozenset(["composite", "flexcomp"])
_ALSO_READ: Mapping[str, str] = {
    "mesh": "class name file face inertia refpos refquat scale vertex",
    "hfield": "name file elevation ncol nrow size",
    "texture": "name file type",
    "material": "class name rgba texture",
    "camera": "name",
    "light": "name",
    "pair": "name geom1 geom2",
    "exclude": "name body1 body2",
    "numeric": "name",
    "text": "name",
    "tuple": "name",
    "default": "class",
    **dict.fromkeys(["layer", "lengthrange", "element"], ""),
}
"""Attributes that are read, besides those of `NOT_USED`, of elements whose unknown attributes the reader does
not refuse."""


def unknown_parts(root: Element) -> Iterator[tuple[Element, str]]:
    """Yield the elements and attributes that MJCF does not have, and that the reader does not refuse: those
    of one kind together, the first element with a sentence."""
    found: dict[str, list[Element]] = {}
    sections = [each for each in root.children if each.tag in IN_SECTIONS]
    for element in (root, *(section for section in sections if section.tag in _WITHOUT_ATTRIBUTES)):
        for name in element.attributes:
            if element is not root or name != "model":
                found.setdefault(f"unknown attribute {shown(name)} of <{element.tag}>", []).append(element)
    waiting = [(section, IN_SECTIONS[section.tag]) for section in sections]
    while waiting:
        element, known = waiting.pop()
        for child in element.children:
            if child.tag not in known.split():
                found.setdefault(f"unknown element <{child.tag}> in <{element.tag}>", []).append(child)
            elif child.tag not in _CLOSED:
                waiting.append((child, IN_ELEMENTS.get(child.tag, "")))
        if element.tag in _ALSO_READ:
            listed = " ".join((_ALSO_READ[element.tag], *NOT_USED.get(element.tag, {}).values())).split()
            for name in element.attributes:
                if name not in listed:
                    kind = f"unknown attribute {shown(name)} of <{element.tag}>"
                    found.setdefault(kind, []).append(element)
    for words, elements in found.items():
        times = "" if len(elements) == 1 else f" ({len(elements)} times)"
        first = min(elements, key=lambda each: each.line)
        yield first, f"{escaped(words)} was ignored{times}"


# -- numbers ----------------------------------------------------------------------------------------------

_SEPARATORS = re.compile(r"[\s,;]+")
_TAGS_OF_TEXT = frozenset(["text", "config"])
_WORDS = (
    "name class childclass model file prefix material mesh hfield texture target joint joint1 joint2 body "
    "body1 body2 bodyname geom geom1 geom2 site site1 site2 refsite cranksite slidersite sidesite tendon "
    "tendon1 tendon2 actuator jointinparent objname refname sensor key"
)
"""Attributes that hold a name, which may look like numbers."""


def attributes_with_commas(tag: str, attributes: Mapping[str, str]) -> Iterator[str]:
    """Yield the attributes of an element whose text is numbers with commas or semicolons.

    MJCF separates numbers by white space, and MuJoCo refuses such an attribute.
    """
    if tag in _TAGS_OF_TEXT:
        return
    for name, text in attributes.items():
        if ("," in text or ";" in text) and name not in _WORDS.split():
            words = [word for word in _SEPARATORS.split(text) if word]
            if words and all(map(DECIMAL.fullmatch, words)):
                yield name


def commas_in_numbers(root: Element) -> Iterator[tuple[Element, str]]:
    """Yield the attributes of a document whose numbers have commas, those of one kind of element together:
    the first element, and a sentence.

    They are attributes that dynx does not read: it refuses such a text in those that it reads.
    """
    found: dict[tuple[str, str], list[Element]] = {}
    waiting = [root]
    while waiting:
        element = waiting.pop()
        waiting += reversed(element.children)
        for name in attributes_with_commas(element.tag, element.attributes):
            found.setdefault((element.tag, name), []).append(element)
    for (tag, name), elements in found.items():
        times = "" if len(elements) == 1 else f" ({len(elements)} times)"
        text = shown(elements[0].attributes[name])
        yield elements[0], f"{escaped(name)} of <{escaped(tag)}> is {text}{times}; MuJoCo refuses commas"
