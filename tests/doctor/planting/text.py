"""Planters of DX4: defects of the text itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules.numbers_in_text import is_number
from tests.doctor.planting.inertia import MOMENTS, PRODUCTS
from tests.doctor.planting.joints import limited, moving
from tests.doctor.planting.site import CannotPlant, PlantedDefect, Planter, Site

LIMITS = ("lower", "upper", "effort", "velocity")

MAX_LINE_BYTES = 8191
"""Bytes of a line that PyBullet reads at once."""


@dataclass(frozen=True)
class Number:
    """An attribute that holds numbers, and its link or joint."""

    element: SourceElement
    name: str
    link: str | None = None
    joint: str | None = None

    @property
    def text(self) -> str:
        """Text at the place."""
        return self.element.attributes[self.name]

    @property
    def unit(self) -> str:
        """Unit that may follow the number."""
        return {"mass": "kg", "limit": "rad"}.get(self.element.tag, "m")


def decimal_comma(site: Site) -> PlantedDefect:
    """Numbers printed with a decimal comma."""
    number = _pick(site, [*_in_bodies(site), *_origins(site), *_limits(site)], lambda text: "." in text)
    return _rewrite(site, "DX401", number, number.text.strip().replace(".", ","))


def commas_between(site: Site) -> PlantedDefect:
    """A vector with commas between its numbers."""
    number = _pick(site, [*_origins(site), *_axes(site)], _is_vector)
    return _rewrite(site, "DX402", number, site.rng.choice([", ", ",", "; "]).join(number.text.split()))


def text_after(site: Site) -> PlantedDefect:
    """A unit, a second point or a C suffix."""
    number = _pick(site, [*_in_bodies(site), *_origins(site), *_limits(site)])
    words = number.text.split()
    k = site.rng.randrange(len(words))
    words[k] += site.rng.choice([number.unit, "f", "." if "." in words[k] else ".."])
    return _rewrite(site, "DX403", number, " ".join(words))


def wrong_length(site: Site) -> PlantedDefect:
    """Two numbers, or four."""
    number = _pick(site, _origins(site), _is_vector)
    words = number.text.split()
    words = words[:2] if site.rng.random() < 0.5 else [*words, "0"]
    return _rewrite(site, "DX404", number, " ".join(words))


def blank_after(site: Site) -> PlantedDefect:
    """A blank behind a number; every engine reads one in front."""
    number = _pick(site, [*_in_bodies(site), *_limits(site)])
    left, right = site.rng.choice([("", " "), (" ", " "), ("", "\n    ")])
    return _rewrite(site, "DX405", number, f"{left}{number.text.strip()}{right}")


def tab_in_vector(site: Site) -> PlantedDefect:
    """A vector over two lines, or typed with the tabulator."""
    number = _pick(site, _origins(site), _is_vector)
    first, second, third = number.text.split()
    text = site.rng.choice(
        [f"{first}\t{second}\t{third}", f"{first} {second}\n      {third}", f"{first} \u00a0{second} {third}"]
    )
    return _rewrite(site, "DX406", number, text)


def infinite(site: Site) -> PlantedDefect:
    """A limit of infinity, as C prints it."""
    number = _pick(site, [each for each in _limits(site) if each.name != "lower"])
    return _rewrite(site, "DX407", number, site.rng.choice(["inf", "Infinity", "1e999"]))


def empty_vector(site: Site) -> PlantedDefect:
    """A template whose variable was empty."""
    return _rewrite(site, "DX408", _pick(site, _origins(site)), site.rng.choice(["", " "]))


def without_number(site: Site) -> PlantedDefect:
    """A lower limit that was not filled in; words have no remedy."""
    ranges = {each.name: each.limits for each in site.model.joints}
    lower = [each for each in _limits(site) if each.name == "lower" and float(each.text) < 0.0]
    wide = [each for each in lower if each.joint is not None and ranges[each.joint].upper > 0.0]
    return _rewrite(site, "DX420", _pick(site, wide), site.rng.choice(["", " "]))


def typographic_minus(site: Site) -> PlantedDefect:
    """Numbers copied from a document."""
    number = _pick(site, [*_origins(site), *_limits(site)], lambda text: "-" in text)
    return _rewrite(site, "DX421", number, number.text.replace("-", site.rng.choice("\u2212\u2013")))


def missing_product(site: Site) -> PlantedDefect:
    """Products of inertia that are zero, left out."""
    name, link = site.pick_link(site.skeleton.solid, "body")
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("inertia")
    if element is None:
        raise CannotPlant("the link has no tensor")
    zero = [
        each for each in PRODUCTS if each in element.attributes and float(element.attributes[each]) == 0.0
    ]
    if not zero:
        raise CannotPlant("no product is zero")
    gone = zero if site.rng.random() < 0.5 else [site.rng.choice(zero)]
    return site.defect("DX409", *(site.source.attribute_removal(element, each) for each in gone), link=name)


def incomplete(site: Site) -> PlantedDefect:
    """The mass between the tags in place of an attribute."""
    name, link = site.pick_link(site.skeleton.solid, "body")
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("mass")
    if element is None:
        raise CannotPlant("the link has no mass")
    edit = site.source.replacement(element, f"<mass>{element.attributes['value'].strip()}</mass>")
    return site.defect("DX410", edit, link=name)


def repeated(site: Site) -> PlantedDefect:
    """A repeated element that may occur once."""
    if site.rng.random() < 0.5:
        name, link = site.pick_link(site.skeleton.solid, "body")
        inertial = link.first("inertial")
        assert inertial is not None
        text = '<inertial>\n  <mass value="1.0"/>\n  <inertia '
        text += " ".join(f'{each}="0.01"' for each in MOMENTS) + ' ixy="0" ixz="0" iyz="0"/>\n</inertial>'
        return site.defect("DX411", site.source.insertion_after(inertial, text), link=name)
    joint, element = site.pick_joint(moving, "joint that moves")
    old = {"origin": '<origin xyz="0 0 0.1" rpy="0 0 0"/>', "axis": '<axis xyz="1 0 0"/>'}
    tags = [tag for tag in old if element.first(tag) is not None]
    tag = site.pick(tags, "origin or axis")
    first = element.first(tag)
    assert first is not None
    return site.defect("DX411", site.source.insertion_after(first, old[tag]), joint=joint.name)


def without_name(site: Site) -> PlantedDefect:
    """A robot without name, or with an empty one."""
    root = site.source.root
    if not root.attributes.get("name"):
        raise CannotPlant("the robot has no name")
    empty = site.rng.random() < 0.5
    edit = (
        site.source.attribute_edit(root, "name", "") if empty else site.source.attribute_removal(root, "name")
    )
    return site.defect("DX412", edit, sign="<robot")


def line_too_long(site: Site) -> PlantedDefect:
    """The inertial of a link behind a long comment on the same line: the cut falls into its mass."""
    skeleton = site.skeleton
    name, link = site.pick_link(
        # A point mass on the only axis about which it rotates has no effect.
        lambda each: skeleton.ranks[each] >= 2 and skeleton.mass(each) > 1e-3,
        "heavy link that turns in two ways",
    )
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("mass")
    if inertial is None or element is None:
        raise CannotPlant("the link has no mass")
    data = site.source.data
    place = element.places["value"]
    text = element.attributes["value"]
    digit = next(k for k, each in enumerate(text) if each in "123456789")
    rest = text[digit + 1 :].strip("0.")
    if not rest or "e" in text or text not in data[place.start : place.end].decode("utf-8"):
        raise CannotPlant("the mass has but one digit")
    at = data.index(text.encode("utf-8"), place.start) + digit + 1
    joined = [
        Edit(k, k + 1, " ")
        for k in range(inertial.span.start, inertial.span.end)
        if data[k : k + 1] in b"\r\n"
    ]
    begin = data.rfind(b"\n", 0, inertial.span.start) + 1
    words = " as in the drawing of the first prototype, see the notes on mass properties;"
    room = MAX_LINE_BYTES - (at - begin) - len("<!-- -->")
    comment = f"<!--{(words * (1 + room // len(words)))[:room]} -->"
    edit = Edit(inertial.span.start, inertial.span.start, comment)
    return site.defect("DX413", edit, *joined, link=name)


def _is_default(element: SourceElement) -> bool:
    """Whether the element gives what a reader takes without it: no offset, or the axis x."""
    default = {"origin": {0.0}, "axis": {1.0, 0.0}}.get(element.tag)
    words = [word for text in element.attributes.values() for word in text.split()]
    if default is None or not all(is_number(word) for word in words):
        return False
    numbers = [float(word) for word in words]
    return set(numbers) <= default and (element.tag == "origin" or numbers[:1] == [1.0])


def lone_carriage_return(site: Site) -> PlantedDefect:
    """The end of one line converted for an old Macintosh, in front of an element that PyBullet then loses."""
    joint, element = site.pick_joint(moving, "joint that moves")
    data = site.source.data
    lost = [
        child.span.start
        for child in element.children
        if child.tag in ("origin", "axis", "parent", "child") and not _is_default(child)
    ]
    ends = [data.rfind(b"\n", 0, start) for start in lost]
    ends = [end for end, start in zip(ends, lost, strict=True) if not data[end:start].strip()]
    if not ends or b"\r" in data:
        raise CannotPlant("no element on a line of its own")
    end = site.rng.choice(ends)
    text = (data[:end] + b"\r" + data[end + 1 :]).decode("utf-8")
    taken = site.taken | {joint.name}
    return PlantedDefect(XmlSource(text, site.source.source), ("DX422", None, None), taken)


def percent(site: Site) -> PlantedDefect:
    """A name with a per cent sign."""
    tag = site.rng.choice(["link", "joint"])
    if tag == "link":
        old, _ = site.pick_link(lambda each: True, "link")
        new = f"{old}_50%"
        return site.defect("DX414", *site.rename_edits(tag, old, new), link=new, touched=[old])
    joint, _ = site.pick_joint(lambda each: True, "joint")
    new = f"{joint.name}_100%d"
    return site.defect("DX414", *site.rename_edits(tag, joint.name, new), joint=new, touched=[joint.name])


def material_twice(site: Site) -> PlantedDefect:
    """Two materials of one name."""
    colours = ['<color rgba="0.5 0.5 0.5 1"/>', '<color rgba="0.2 0.2 0.2 1"/>']
    text = "\n".join(f'<material name="hand_grey">\n  {colour}\n</material>' for colour in colours)
    edit = site.source.insertion(site.source.root, text, first=site.rng.random() < 0.5)
    return site.defect("DX415", edit, sign="hand_grey")


def unknown_version(site: Site) -> PlantedDefect:
    """A version that URDF does not have."""
    if "version" in site.source.root.attributes:
        raise CannotPlant("has a version")
    version = site.rng.choice(["2.0", "1.4.2", "3"])
    return site.defect(
        "DX416", site.source.attribute_edit(site.source.root, "version", version), sign="<robot"
    )


def unknown_shape(site: Site) -> PlantedDefect:
    """A plane, which PyBullet alone reads as a collision shape."""
    name, link = site.pick_link(lambda each: True, "link")
    shape = '<collision>\n  <geometry>\n    <plane normal="0 0 1"/>\n  </geometry>\n</collision>'
    return site.defect("DX417", site.source.insertion(link, shape), link=name)


# -- positions of numbers -------------------------------------------------------------------------


def _in_bodies(site: Site) -> list[Number]:
    """List masses of moving links and moments of rotating ones (Pinocchio keeps the mass of a bad tensor)."""
    found = []
    for part in site.source.root.all("link"):
        name = part.attributes["name"]
        if not site.free(name) or name not in site.skeleton.heads:
            continue
        if not (site.skeleton.solid(name) and site.skeleton.moves(name)):
            continue
        moments = MOMENTS if site.skeleton.ranks[name] else ()
        for tag, words in (("mass", ("value",)), ("inertia", moments)):
            found += [
                Number(each, word, link=name) for each in _inside(part, "inertial", tag) for word in words
            ]
    return found


def _origins(site: Site) -> list[Number]:
    """List origins of joints, and of the inertials of links that move."""
    found = []
    for part in site.source.root.children:
        name = part.attributes.get("name", "")
        if part.tag not in ("link", "joint") or not site.free(name):
            continue
        if part.tag == "link":
            body = name in site.skeleton.heads and site.skeleton.moves(name) and site.skeleton.solid(name)
            places = _inside(part, "inertial", "origin") if body else []
        else:
            places = part.all("origin")[:1]
        owner = {part.tag: name}
        found += [
            Number(each, word, **owner)
            for each in places
            for word in ("xyz", "rpy")
            if word in each.attributes
        ]
    return found


def _axes(site: Site) -> list[Number]:
    """List axes of joints that move."""
    found = []
    for joint in site.model.joints:
        if moving(joint) and site.free(joint.name):
            axis = site.element("joint", joint.name).first("axis")
            if axis is not None and "xyz" in axis.attributes:
                found.append(Number(axis, "xyz", joint=joint.name))
    return found


def not_utf8(site: Site) -> PlantedDefect:
    """A file of an editor that saves in the code page of its country, with a name in that language."""
    parent, _ = site.pick_link(lambda each: True, "link")
    name = site.rng.choice(["träger", "poignée", "mão", "öglå"])
    text, root = site.source.data, site.source.root
    start = text.find(b"?>") + 2 if text.startswith(b"<?xml") else 0
    if 0 < start <= root.span.start or start == 0:
        declaration = '<?xml version="1.0" encoding="ISO-8859-1"?>' + "\n" * (start == 0)
        inertial = (
            '  <inertial>\n    <mass value="0.25"/>\n'
            '    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.015"/>\n  </inertial>\n'
        )
        link = site.link_insertion(name, parent, inertial=inertial)
        return site.defect("DX440", Edit(0, start, declaration), link, link=name)
    raise CannotPlant("the declaration does not end")


def _limits(site: Site) -> list[Number]:
    """List limits of joints that require them."""
    found = []
    for joint in site.model.joints:
        if limited(joint) and site.free(joint.name):
            limit = site.element("joint", joint.name).first("limit")
            if limit is not None:
                words = [word for word in LIMITS if word in limit.attributes]
                found += [Number(limit, word, joint=joint.name) for word in words]
    return found


def _inside(part: SourceElement, *tags: str) -> list[SourceElement]:
    element: SourceElement | None = part
    for tag in tags:
        element = None if element is None else element.first(tag)
    return [] if element is None else [element]


def _is_vector(text: str) -> bool:
    return len(text.split()) == 3


def _pick(site: Site, numbers: list[Number], fits: Callable[[str], bool] = bool) -> Number:
    return site.pick([each for each in numbers if fits(each.text)], "number of the kind")


def _rewrite(site: Site, rule: str, number: Number, text: str) -> PlantedDefect:
    edit = site.text_edit(number.element, number.name, text)
    return site.defect(rule, edit, link=number.link, joint=number.joint)


PLANTERS = (
    Planter("DX401", decimal_comma),
    Planter("DX402", commas_between),
    Planter("DX403", text_after),
    Planter("DX404", wrong_length),
    Planter("DX405", blank_after),
    Planter("DX406", tab_in_vector),
    Planter("DX407", infinite),
    Planter("DX408", empty_vector),
    Planter("DX420", without_number),
    Planter("DX421", typographic_minus),
    Planter("DX409", missing_product),
    Planter("DX410", incomplete),
    Planter("DX411", repeated),
    Planter("DX412", without_name),
    Planter("DX413", line_too_long),
    Planter("DX414", percent),
    Planter("DX415", material_twice),
    Planter("DX416", unknown_version),
    Planter("DX417", unknown_shape),
    Planter("DX422", lone_carriage_return),
    Planter("DX440", not_utf8),
)
