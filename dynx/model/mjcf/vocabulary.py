"""Attributes of MJCF that dynx does not use, by the elements that have them, and what follows.

A note names those with an effect in MuJoCo. The others draw something, organise the file, or are settings of
MuJoCo's program, and a robot is the same without them. An attribute that neither this table nor the reader
has is misspelt.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from dynx.model.xml.reading import Element

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
    "body": {_NO_EFFECT: "sleep user"},
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
