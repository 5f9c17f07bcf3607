"""Planters of DX3: joint dynamics and forces that engines add to rigid bodies."""

from __future__ import annotations

from tests.doctor.planting.joints import SINGLE, driven, limited, moving, transmission
from tests.doctor.planting.site import CannotPlant, PlantedDefect, Planter, Site


def damping(site: Site) -> PlantedDefect:
    """Viscous friction identified on the machine."""
    return _dynamics(site, "DX301", damping=site.rng.choice(["0.5", "0.01", "12.0"]))


def friction(site: Site) -> PlantedDefect:
    """Dry friction identified on the machine."""
    return _dynamics(site, "DX302", friction=site.rng.choice(["0.2", "0.03", "5.0"]))


def negative_damping(site: Site) -> PlantedDefect:
    """A wrong sign; a negative damping enters torques too, so DX301 also applies."""
    return _dynamics(site, "DX303", also=["DX301"], damping=site.rng.choice(["-0.1", "-2.0"]))


def mimic(site: Site) -> PlantedDefect:
    """One joint follows another, as the fingers of a gripper do."""
    joint, element = site.pick_joint(moving, "joint that moves")
    followed, _ = site.pick_joint(lambda each: moving(each) and each is not joint, "joint to follow")
    multiplier = site.rng.choice(["1", "-1", "0.5"])
    text = f'<mimic joint="{followed.name}" multiplier="{multiplier}" offset="0"/>'
    return site.defect(
        "DX304", site.source.insertion(element, text), joint=joint.name, touched=[followed.name]
    )


def empty_dynamics(site: Site) -> PlantedDefect:
    """The empty element of a template."""
    joint, element = site.pick_joint(lambda each: each.type in SINGLE, "joint that moves")
    edit = site.source.insertion(element, "<dynamics/>")
    return site.defect("DX305", edit, joint=joint.name)


def no_room(site: Site) -> PlantedDefect:
    """A range of zero width."""
    joint, element = site.pick_joint(limited, "joint with a limit")
    value = site.rng.choice(["0", "0.0", "0.3"])
    edits = site.part_edits(element, "limit", lower=value, upper=value)
    return site.defect("DX306", *edits, joint=joint.name)


def rotor(site: Site) -> PlantedDefect:
    """The rotor of a geared motor, as Drake's extension has it."""
    joint, _ = site.pick_joint(driven, "joint that moves")
    inside = (
        f'  <joint name="{joint.name}"/>\n  <actuator name="motor_of_{joint.name}">\n'
        '    <drake:rotor_inertia value="0.0003"/>\n    <drake:gear_ratio value="50"/>\n  </actuator>'
    )
    text = transmission(f"gear_of_{joint.name}", inside)
    return site.defect("DX307", site.source.insertion(site.source.root, text), joint=joint.name)


def contacts(site: Site) -> PlantedDefect:
    """Shapes larger than the links, on a link and on a link two joints below it.

    They are off centre: the distance of two points on axes that intersect is constant, so that a contact
    between them has no torque.
    """
    skeleton = site.skeleton
    upper = {joint.child: joint.parent for joint in site.model.joints}
    pairs = []
    for link in upper:
        between = upper.get(skeleton.heads[link])
        if between is None or skeleton.heads[between] not in upper:
            continue
        far = upper[skeleton.heads[between]]
        if site.free(link, far):
            pairs.append((far, link))
    first, second = site.pick(pairs, "links with two joints between them")
    place, sphere = '<origin xyz="0.3 0.2 -0.1"/>', '<sphere radius="1.5"/>'
    shape = f"<collision>\n  {place}\n  <geometry>\n    {sphere}\n  </geometry>\n</collision>"
    edits = [site.source.insertion(site.element("link", name), shape) for name in (first, second)]
    return site.defect("DX308", *edits, touched=[first, second], sign="<collision>")


def _dynamics(site: Site, rule: str, also: tuple[str, ...] | list[str] = (), **words: str) -> PlantedDefect:
    joint, element = site.pick_joint(moving, "joint that moves")
    if element.first("dynamics") is not None:
        raise CannotPlant("the joint has dynamics")
    return site.defect(rule, *site.part_edits(element, "dynamics", **words), joint=joint.name, also=also)


PLANTERS = (
    Planter("DX301", damping),
    Planter("DX302", friction),
    Planter("DX303", negative_damping),
    Planter("DX304", mimic),
    Planter("DX305", empty_dynamics),
    Planter("DX306", no_room),
    Planter("DX307", rotor),
    Planter("DX308", contacts),
)
