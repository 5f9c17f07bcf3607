"""Planters of DX1: defects of masses and tensors."""

from __future__ import annotations

from decimal import Decimal

import numpy as np

from dynx.model.elements import Inertial
from dynx.model.xml.source import Edit, SourceElement
from tests.doctor.planting.site import CannotPlant, PlantedDefect, Planter, Site

MOMENTS = ("ixx", "iyy", "izz")
PRODUCTS = ("ixy", "ixz", "iyz")

ZERO = '  <inertial>\n    <mass value="0"/>\n    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>\n'
ZERO += "  </inertial>\n"


def without_inertial(site: Site) -> PlantedDefect:
    """A frame without mass on a link that moves."""
    skeleton = site.skeleton
    parent, _ = site.pick_link(lambda each: skeleton.moves(each) and skeleton.mass(each) > 0.0, "heavy link")
    name = site.rng.choice(["tool0", "camera_frame", "ee_link", "imu_site", "ft_sensor"])
    if has_link(site, name):
        raise CannotPlant(f"has a link {name}")
    return site.defect("DX101", site.link_insertion(name, parent), link=name, touched=[parent])


def on_the_edge(site: Site) -> PlantedDefect:
    """A thin plate whose moments, in few decimals, miss the triangle inequality by rounding."""
    name, link, old = rotating_body(site)
    size = max(old.ixx, old.iyy, old.izz)
    digits = -int(np.floor(np.log10(size))) + 2
    while True:
        small, middle = (Decimal(site.rng.randint(11, 499)).scaleb(-digits) for _ in range(2))
        large = small + middle
        if float(large) > float(small) + float(middle):
            break
    moments = [str(small), str(middle), str(large)]
    site.rng.shuffle(moments)
    edits = tensor(site, link, **dict(zip(MOMENTS, moments, strict=True)), **dict.fromkeys(PRODUCTS, "0"))
    return site.defect("DX102", *edits, link=name)


def of_no_body(site: Site) -> PlantedDefect:
    """A decimal point in the wrong place, or one small number for all six."""
    name, link, old = solid_body(site)
    if site.rng.random() < 0.25:
        words = dict.fromkeys((*MOMENTS, *PRODUCTS), "1e-6")
        if not site.skeleton.ranks[name]:
            raise CannotPlant("the tensor would not matter")
        return site.defect("DX103", *tensor(site, link, **words), link=name)
    which = site.rng.choice(MOMENTS)
    value = getattr(old, which)
    others = sum(getattr(old, each) for each in MOMENTS) - value
    while value < 2.0 * others:
        value *= 10.0
    edits = tensor(site, link, **{which: f"{value:.6g}"}, **dict.fromkeys(PRODUCTS, "0"))
    return site.defect("DX103", *edits, link=name)


def negative(site: Site) -> PlantedDefect:
    """A wrong sign, or a product of inertia ten times too large."""
    name, link, old = solid_body(site)
    if site.rng.random() < 0.5:
        which = site.rng.choice(MOMENTS)
        words = {which: f"-{getattr(old, which):.6g}", **dict.fromkeys(PRODUCTS, "0")}
    else:
        words = {**dict.fromkeys(PRODUCTS, "0"), "ixy": f"{10.0 * max(old.ixx, old.iyy):.6g}"}
    return site.defect("DX104", *tensor(site, link, **words), link=name)


def negative_mass(site: Site) -> PlantedDefect:
    """A minus sign in front of the mass of a body that moves."""
    name, link, _ = rotating_body(site)
    mass = next((each for each in link.walk() if each.tag == "mass"), None)
    if mass is None:
        raise CannotPlant("the link has no mass")
    edit = site.source.attribute_edit(mass, "value", f"-{mass.attributes['value'].strip()}")
    return site.defect("DX120", edit, link=name)


def not_diagonal(site: Site) -> PlantedDefect:
    """The tensor of a nearly round body as CAD exports it, with small products of inertia.

    Bullet drops what is below a millionth of the tensor. On a body of less than a thousandth of the
    robot's largest inertia the effect is below the tolerance, and no defect.
    """
    skeleton = site.skeleton
    name, link = site.pick_link(
        lambda each: (
            skeleton.solid(each)
            and skeleton.ranks[each] == 3
            and skeleton.size(each) > 1e-3 * skeleton.largest_inertia
        ),
        "large body that turns in every way",
    )
    size = skeleton.size(name)
    moments = {each: f"{size * site.rng.uniform(0.9, 1.0):.9g}" for each in MOMENTS}
    products = {
        each: f"{site.rng.choice((-1, 1)) * size * site.rng.uniform(2e-7, 9e-7):.9g}" for each in PRODUCTS
    }
    return site.defect("DX105", *tensor(site, link, **moments, **products), link=name)


def root_rotated(site: Site) -> PlantedDefect:
    """The axes of the root's inertial rotated, as CAD programs export them."""
    root = site.model.root
    if not site.free(root):
        raise CannotPlant("the root is taken")
    link = site.element("link", root)
    inertial = link.first("inertial")
    if inertial is None:
        raise CannotPlant("the root has no inertial")
    if not any(joint.moves for joint in site.model.joints):
        raise CannotPlant("nothing moves")
    rpy = site.rng.choice(["0 1.5708 0", "1.5708 0 0", "0.3 -0.2 0.1", "-0.785398 0.52 1.1"])
    origin = inertial.first("origin")
    if origin is None:
        edit = site.source.insertion(inertial, f'<origin xyz="0 0 0" rpy="{rpy}"/>', first=True)
    else:
        edit = site.source.attribute_edit(origin, "rpy", rpy)
    return site.defect("DX106", edit, link=root)


def massless_root(site: Site) -> PlantedDefect:
    """A root without mass: above a floating robot, or its own root."""
    root = site.model.root
    if not site.free(root) or site.skeleton.mass(root) == 0.0:
        raise CannotPlant("the root is taken, or has no mass")
    if site.rng.random() < 0.5:
        edits = weightless(site, site.element("link", root))
        return site.defect("DX107", *edits, link=root, touched=site.skeleton.rigid_group(root))
    name = site.rng.choice(["base_footprint", "root_link"])
    if has_link(site, name):
        raise CannotPlant(f"has a link {name}")
    text = (
        f'<link name="{name}">\n{ZERO}</link>\n<joint name="{name}_joint" type="fixed">\n'
        f'  <origin xyz="0 0 0.1" rpy="0 0 0"/>\n'
        f'  <parent link="{name}"/>\n  <child link="{root}"/>\n</joint>'
    )
    edit = site.source.insertion(site.source.root, text, first=True)
    return site.defect("DX107", edit, link=name, touched=[root])


def massless_with_inertia(site: Site) -> PlantedDefect:
    """The mass set to zero and the tensor kept; a floating root without mass is DX107."""
    skeleton = site.skeleton
    name, link = site.pick_link(
        lambda each: each != site.model.root and skeleton.moves(each) and skeleton.solid(each), "moving body"
    )
    return site.defect("DX108", *mass(site, link, "0"), link=name)


def named_world(site: Site) -> PlantedDefect:
    """A link named world."""
    if has_link(site, "world"):
        raise CannotPlant("has a link world")
    root = site.model.root
    name, _ = site.pick_link(
        lambda each: site.model.floating or (each != root and site.skeleton.moves(each)), "link to rename"
    )
    edits = site.rename_edits("link", name, "world")
    return site.defect("DX109", *edits, link="world", touched=[name])


def massless_moving(site: Site) -> PlantedDefect:
    """A link without inertia between two joints."""
    skeleton = site.skeleton
    names = {each.name for each in site.model.links}
    heavy = {each for each in names - site.taken if skeleton.mass(each) > 0.0}
    name, link = site.pick_link(
        lambda each: (
            skeleton.solid(each)
            and skeleton.is_single_body(each)
            and any(heavy.intersection(skeleton.rigid_group(far)) for far in skeleton.groups_beyond(each))
        ),
        "body between two joints",
    )
    return site.defect("DX110", *weightless(site, link), link=name, touched=skeleton.rigid_group(name))


def too_small(site: Site) -> PlantedDefect:
    """Moments in a unit that is far too large."""
    skeleton = site.skeleton
    name, link = site.pick_link(
        lambda each: skeleton.solid(each) and skeleton.is_single_body(each), "body on a joint"
    )
    value = site.rng.choice(["1e-15", "3e-16", "2.5e-17"])
    words = {**dict.fromkeys(MOMENTS, value), **dict.fromkeys(PRODUCTS, "0")}
    return site.defect("DX111", *tensor(site, link, **words), link=name)


def singular(site: Site) -> PlantedDefect:
    """The last body of a chain without mass."""
    skeleton = site.skeleton
    others = [
        each.name for each in site.model.links if skeleton.moves(each.name) and skeleton.mass(each.name)
    ]
    name, link = site.pick_link(
        lambda each: (
            skeleton.solid(each)
            and skeleton.is_single_body(each)
            and not skeleton.groups_beyond(each)
            and any(skeleton.heads[other] != each for other in others)
            and not any(each in skeleton.groups_beyond(other) for other in site.taken & skeleton.heads.keys())
        ),
        "body at the end of a chain",
    )
    return site.defect("DX113", *weightless(site, link), link=name, touched=skeleton.rigid_group(name))


def scaled(site: Site) -> PlantedDefect:
    """PyBullet's extension that scales inertia for stable contacts."""
    name, link, _ = rotating_body(site)
    value = site.rng.choice(["3.0", "0.5", "10"])
    contact = link.first("contact")
    scaling = f'<inertia_scaling value="{value}"/>'
    if contact is not None:
        edit = site.source.insertion(contact, scaling)
    else:
        text = f'<contact>\n  <lateral_friction value="1.0"/>\n  {scaling}\n</contact>'
        edit = site.source.insertion(link, text)
    return site.defect("DX114", edit, link=name)


# -- helpers --------------------------------------------------------------------------------


def has_link(site: Site, name: str) -> bool:
    """Check for a link of that name in the clean robot or the text."""
    here = [each.attributes.get("name") for each in site.source.root.all("link")]
    return name in here or any(each.name == name for each in site.model.links)


def solid_body(site: Site) -> tuple[str, SourceElement, Inertial]:
    """Draw a link with mass and inertia, moving or not."""
    name, link = site.pick_link(site.skeleton.solid, "body")
    inertial = site.skeleton.inertial(name)
    assert inertial is not None
    return name, link, inertial


def rotating_body(site: Site, rank: int = 1) -> tuple[str, SourceElement, Inertial]:
    """Draw a link with mass and inertia that rotates about at least `rank` independent directions."""
    skeleton = site.skeleton
    name, link = site.pick_link(
        lambda each: skeleton.solid(each) and skeleton.ranks[each] >= rank, f"body that turns in {rank} ways"
    )
    inertial = skeleton.inertial(name)
    assert inertial is not None
    return name, link, inertial


def tensor(site: Site, link: SourceElement, **words: str) -> list[Edit]:
    """Set numbers of the tensor of a link."""
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("inertia")
    if element is None:
        raise CannotPlant("the link has no tensor")
    return [site.source.attribute_edit(element, name, value) for name, value in words.items()]


def mass(site: Site, link: SourceElement, value: str) -> list[Edit]:
    """Set the mass of a link."""
    inertial = link.first("inertial")
    element = None if inertial is None else inertial.first("mass")
    if element is None:
        raise CannotPlant("the link has no mass")
    return [site.source.attribute_edit(element, "value", value)]


def weightless(site: Site, link: SourceElement) -> list[Edit]:
    """Set every number of a link's inertia to zero."""
    return mass(site, link, "0.0") + tensor(site, link, **dict.fromkeys((*MOMENTS, *PRODUCTS), "0.0"))


PLANTERS = (
    Planter("DX101", without_inertial),
    Planter("DX102", on_the_edge),
    Planter("DX103", of_no_body),
    Planter("DX104", negative),
    Planter("DX120", negative_mass),
    Planter("DX105", not_diagonal),
    Planter("DX106", root_rotated, ("fixed",)),
    Planter("DX107", massless_root, ("floating",)),
    Planter("DX108", massless_with_inertia),
    Planter("DX109", named_world),
    Planter("DX110", massless_moving),
    Planter("DX111", too_small),
    Planter("DX113", singular),
    Planter("DX114", scaled),
)
