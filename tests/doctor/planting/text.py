"""DX4: what can be wrong with the text itself, planted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from dynx.model.xml.source import Edit, SourceElement
from tests.doctor.planting.inertia import MOMENTS, PRODUCTS
from tests.doctor.planting.joints import limited, moving
from tests.doctor.planting.site import NotHere, Planted, Planter, Site

LIMITS = ("lower", "upper", "effort", "velocity")

LINE = 8191
"""Bytes of a line that PyBullet reads at once."""


@dataclass(frozen=True)
class Number:
    """An attribute that holds numbers, and whose it is."""

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


def decimal_comma(site: Site) -> Planted:
    """Numbers printed by a computer that speaks French."""
    number = _pick(site, [*_in_bodies(site), *_origins(site), *_limits(site)], lambda text: "." in text)
    return _rewritten(site, "DX401", number, number.text.strip().replace(".", ","))


def commas_between(site: Site) -> Planted:
    """A vector as other formats have it."""
    number = _pick(site, [*_origins(site), *_axes(site)], _is_vector)
    return _rewritten(site, "DX402", number, site.rng.choice([", ", ",", "; "]).join(number.text.split()))


def text_after(site: Site) -> Planted:
    """A unit, a second point or a C suffix."""
    number = _pick(site, [*_in_bodies(site), *_origins(site), *_limits(site)])
    words = number.text.split()
    k = site.rng.randrange(len(words))
    words[k] += site.rng.choice([number.unit, "f", "." if "." in words[k] else ".."])
    return _rewritten(site, "DX403", number, " ".join(words))


def wrong_length(site: Site) -> Planted:
    """Two numbers, or four."""
    number = _pick(site, _origins(site), _is_vector)
    words = number.text.split()
    words = words[:2] if site.rng.random() < 0.5 else [*words, "0"]
    return _rewritten(site, "DX404", number, " ".join(words))


def blank_after(site: Site) -> Planted:
    """A blank left over from a template; one in front alone is read by all."""
    number = _pick(site, [*_in_bodies(site), *_limits(site)])
    left, right = site.rng.choice([("", " "), (" ", " "), ("", "\n    ")])
    return _rewritten(site, "DX405", number, f"{left}{number.text.strip()}{right}")


def tab_in_vector(site: Site) -> Planted:
    """A vector over two lines, or typed with the tabulator."""
    number = _pick(site, _origins(site), _is_vector)
    first, second, third = number.text.split()
    text = site.rng.choice(
        [f"{first}\t{second}\t{third}", f"{first} {second}\n      {third}", f"{first} \u00a0{second} {third}"]
    )
    return _rewritten(site, "DX406", number, text)


def infinite(site: Site) -> Planted:
    """Write infinity as C prints it."""
    number = _pick(site, [each for each in _limits(site) if each.name != "lower"])
    return _rewritten(site, "DX407", number, site.rng.choice(["inf", "Infinity", "1e999"]))


def empty_vector(site: Site) -> Planted:
    """A template whose variable was empty."""
    return _rewritten(site, "DX408", _pick(site, _origins(site)), site.rng.choice(["", " "]))


def missing_product(site: Site) -> Planted:
    """Products of inertia that are zero, left out."""
    name, link = site.pick_link(site.skeleton.solid, "body")
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("inertia")
    if element is None:
        raise NotHere("the link has no tensor")
    zero = [
        each for each in PRODUCTS if each in element.attributes and float(element.attributes[each]) == 0.0
    ]
    if not zero:
        raise NotHere("no product is zero")
    gone = zero if site.rng.random() < 0.5 else [site.rng.choice(zero)]
    return site.planted("DX409", *(site.source.attribute_removal(element, each) for each in gone), link=name)


def incomplete(site: Site) -> Planted:
    """The mass between the tags in place of an attribute."""
    name, link = site.pick_link(site.skeleton.solid, "body")
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("mass")
    if element is None:
        raise NotHere("the link has no mass")
    edit = site.source.replacement(element, f"<mass>{element.attributes['value'].strip()}</mass>")
    return site.planted("DX410", edit, link=name)


def repeated(site: Site) -> Planted:
    """Two of what can be there once, from a merge."""
    if site.rng.random() < 0.5:
        name, link = site.pick_link(site.skeleton.solid, "body")
        inertial = link.first("inertial")
        assert inertial is not None
        text = '<inertial>\n  <mass value="1.0"/>\n  <inertia '
        text += " ".join(f'{each}="0.01"' for each in MOMENTS) + ' ixy="0" ixz="0" iyz="0"/>\n</inertial>'
        return site.planted("DX411", site.source.insertion_after(inertial, text), link=name)
    joint, element = site.pick_joint(moving, "joint that moves")
    old = {"origin": '<origin xyz="0 0 0.1" rpy="0 0 0"/>', "axis": '<axis xyz="1 0 0"/>'}
    tags = [tag for tag in old if element.first(tag) is not None]
    tag = site.pick(tags, "origin or axis")
    first = element.first(tag)
    assert first is not None
    return site.planted("DX411", site.source.insertion_after(first, old[tag]), joint=joint.name)


def without_name(site: Site) -> Planted:
    """The name of the robot forgotten, or empty."""
    root = site.source.root
    if not root.attributes.get("name"):
        raise NotHere("the robot has no name")
    empty = site.rng.random() < 0.5
    edit = (
        site.source.attribute_edit(root, "name", "") if empty else site.source.attribute_removal(root, "name")
    )
    return site.planted("DX412", edit, sign="<robot")


def line_too_long(site: Site) -> Planted:
    """The inertial of a link behind a long comment on the same line: the cut falls into its mass."""
    skeleton = site.skeleton
    name, link = site.pick_link(
        # The mass of a body in the only axis about which it turns is in no equation.
        lambda each: skeleton.ranks[each] >= 2 and skeleton.mass(each) > 1e-3,
        "heavy link that turns in two ways",
    )
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("mass")
    if inertial is None or element is None:
        raise NotHere("the link has no mass")
    data = site.source.data
    place = element.places["value"]
    text = element.attributes["value"]
    digit = next(k for k, each in enumerate(text) if each in "123456789")
    rest = text[digit + 1 :].strip("0.")
    if not rest or "e" in text or text not in data[place.start : place.end].decode("utf-8"):
        raise NotHere("the mass has but one digit")
    at = data.index(text.encode("utf-8"), place.start) + digit + 1
    joined = [
        Edit(k, k + 1, " ")
        for k in range(inertial.span.start, inertial.span.end)
        if data[k : k + 1] in b"\r\n"
    ]
    begin = data.rfind(b"\n", 0, inertial.span.start) + 1
    words = " as in the drawing of the first prototype, see the notes on mass properties;"
    room = LINE - (at - begin) - len("<!-- -->")
    comment = f"<!--{(words * (1 + room // len(words)))[:room]} -->"
    edit = Edit(inertial.span.start, inertial.span.start, comment)
    return site.planted("DX413", edit, *joined, link=name)


def percent(site: Site) -> Planted:
    """Fifty per cent of something."""
    tag = site.rng.choice(["link", "joint"])
    if tag == "link":
        old, _ = site.pick_link(lambda each: True, "link")
        new = f"{old}_50%"
        return site.planted("DX414", *site.rename_edits(tag, old, new), link=new, touched=[old])
    joint, _ = site.pick_joint(lambda each: True, "joint")
    new = f"{joint.name}_100%d"
    return site.planted("DX414", *site.rename_edits(tag, joint.name, new), joint=new, touched=[joint.name])


def material_twice(site: Site) -> Planted:
    """The colours of an arm and of a hand."""
    colours = ['<color rgba="0.5 0.5 0.5 1"/>', '<color rgba="0.2 0.2 0.2 1"/>']
    text = "\n".join(f'<material name="hand_grey">\n  {colour}\n</material>' for colour in colours)
    edit = site.source.insertion(site.source.root, text, first=site.rng.random() < 0.5)
    return site.planted("DX415", edit, sign="hand_grey")


def unknown_version(site: Site) -> Planted:
    """Somebody counts his own revisions."""
    version = site.rng.choice(["2.0", "1.4.2", "3"])
    return site.planted(
        "DX416", site.source.attribute_edit(site.source.root, "version", version), sign="<robot"
    )


def unknown_shape(site: Site) -> Planted:
    """PyBullet's plane."""
    name, link = site.pick_link(lambda each: True, "link")
    shape = '<collision>\n  <geometry>\n    <plane normal="0 0 1"/>\n  </geometry>\n</collision>'
    return site.planted("DX417", site.source.insertion(link, shape), link=name)


# -- where numbers stand -------------------------------------------------------------------------


def _in_bodies(site: Site) -> list[Number]:
    """Masses of links that move, and moments of those that turn: Pinocchio keeps the mass of a bad tensor."""
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
    """Origins of joints, and of the inertials of links that move."""
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
    """Axes of joints that move."""
    found = []
    for joint in site.model.joints:
        if moving(joint) and site.free(joint.name):
            axis = site.element("joint", joint.name).first("axis")
            if axis is not None and "xyz" in axis.attributes:
                found.append(Number(axis, "xyz", joint=joint.name))
    return found


def _limits(site: Site) -> list[Number]:
    """Limits of joints that have to have some."""
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


def _rewritten(site: Site, rule: str, number: Number, text: str) -> Planted:
    edit = site.text_edit(number.element, number.name, text)
    return site.planted(rule, edit, link=number.link, joint=number.joint)


PLANTERS = (
    Planter("DX401", decimal_comma),
    Planter("DX402", commas_between),
    Planter("DX403", text_after),
    Planter("DX404", wrong_length),
    Planter("DX405", blank_after),
    Planter("DX406", tab_in_vector),
    Planter("DX407", infinite),
    Planter("DX408", empty_vector),
    Planter("DX409", missing_product),
    Planter("DX410", incomplete),
    Planter("DX411", repeated),
    Planter("DX412", without_name),
    Planter("DX413", line_too_long),
    Planter("DX414", percent),
    Planter("DX415", material_twice),
    Planter("DX416", unknown_version),
    Planter("DX417", unknown_shape),
)
