"""Planters of elements and attributes that some engines read and others skip or refuse."""

from __future__ import annotations

import math

from tests.doctor.planting.inertia import has_link
from tests.doctor.planting.joints import limited, moving, require_complete_limits, require_no_version
from tests.doctor.planting.site import CannotPlant, PlantedDefect, Planter, Site


def axis_misspelled(site: Site) -> PlantedDefect:
    """The letters of xyz exchanged, in capitals, or the name of another attribute."""
    joint, element = site.pick_joint(moving, "joint that moves")
    name = site.rng.choice(["xzy", "zyx", "XYZ", "rpy", "value"])
    words = " ".join(map(repr, joint.axis))
    axis = element.first("axis")
    text = f'<axis {name}="{words}"/>'
    edit = site.source.insertion(element, text) if axis is None else site.source.replacement(axis, text)
    return site.defect("DX218", edit, joint=joint.name)


def axis_of_fixed_joint(site: Site) -> PlantedDefect:
    """What a template leaves in a fixed joint."""
    joint, element = site.pick_joint(lambda each: each.type == "fixed", "fixed joint")
    text = site.rng.choice(["<axis/>", '<axis xyz=""/>', '<axis xyz="none"/>', '<axis xyz="0, 0, 1"/>'])
    axis = element.first("axis")
    edit = site.source.insertion(element, text) if axis is None else site.source.replacement(axis, text)
    return site.defect("DX219", edit, joint=joint.name)


def loop_joint(site: Site) -> PlantedDefect:
    """A strut of a parallel mechanism, as Isaac Sim writes it."""
    first, _ = site.pick_link(lambda each: True, "link")
    text = (
        f'<loop_joint name="strut" type="spherical">\n  <link1 link="{first}" xyz="0 0 0" rpy="0 0 0"/>\n'
        f'  <link2 link="{site.model.root}" xyz="0 0 0.1" rpy="0 0 0"/>\n</loop_joint>'
    )
    edit = site.source.insertion(site.source.root, text)
    return site.defect("DX220", edit, sign="loop_joint")


def joint_of_drake(site: Site) -> PlantedDefect:
    """A joint of another kind beside the chain, as a file for Drake has it."""
    name, _ = site.pick_link(lambda each: each != site.model.root, "link below the root")
    kind = site.rng.choice(["ball", "universal", "planar"])
    text = (
        f'<drake:joint name="extra" type="{kind}">\n  <axis xyz="0 0 1"/>\n'
        f'  <parent link="{site.model.root}"/>\n  <child link="{name}"/>\n</drake:joint>'
    )
    return site.defect("DX227", site.source.insertion(site.source.root, text), sign="drake:joint")


def world_not_declared(site: Site) -> PlantedDefect:
    """A robot mounted on Drake's world."""
    if has_link(site, "world") or not site.free(site.model.root):
        raise CannotPlant("has a world, or the root is taken")
    text = (
        '<joint name="mount" type="fixed">\n  <origin xyz="0.1 0.2 0.3" rpy="0 0 0.5"/>\n'
        f'  <parent link="world"/>\n  <child link="{site.model.root}"/>\n</joint>'
    )
    edit = site.source.insertion(site.source.root, text)
    return site.defect("DX221", edit, joint="mount", touched=[site.model.root])


def incomplete_limit(site: Site) -> PlantedDefect:
    """A range of URDF 1.0, without the end that is zero, in a robot that states URDF 1.2."""
    require_no_version(site)
    require_complete_limits(site)
    joint, element = site.pick_joint(
        lambda each: limited(each) and each.limits.lower <= 0.0 < each.limits.upper, "joint with a range"
    )
    limit = element.first("limit")
    if limit is None or "lower" not in limit.attributes:
        raise CannotPlant("has no lower limit")
    version = site.source.attribute_edit(site.source.root, "version", "1.2")
    return site.defect("DX222", version, site.source.attribute_removal(limit, "lower"), joint=joint.name)


def second_root(site: Site) -> PlantedDefect:
    """A table beside the robot."""
    if has_link(site, "table"):
        raise CannotPlant("has a table")
    text = (
        '<link name="table">\n  <inertial>\n    <mass value="9"/>\n'
        '    <inertia ixx="0.4" ixy="0" ixz="0" iyy="0.5" iyz="0" izz="0.6"/>\n  </inertial>\n</link>'
    )
    return site.defect("DX223", site.source.insertion(site.source.root, text), link="table")


def without_geometry(site: Site) -> PlantedDefect:
    """A shape that a template left empty."""
    name, link = site.pick_link(lambda each: True, "link")
    tag = site.rng.choice(["visual", "collision"])
    inside = site.rng.choice(["", "<geometry/>", "<geometry>\n    <ellipsoid/>\n  </geometry>"])
    text = f"<{tag}>\n  {inside}\n</{tag}>"
    return site.defect("DX424", site.source.insertion(link, text), link=name)


def mujoco_settings(site: Site) -> PlantedDefect:
    """Masses scaled to another total, or raised to a least one."""
    total = sum(site.skeleton.mass(each.name) for each in site.model.links)
    value = site.rng.choice([f'boundmass="{2.0 * total:.9g}"', f'settotalmass="{3.0 * total:.9g}"'])
    text = f'<mujoco>\n  <compiler meshdir="meshes" {value}/>\n</mujoco>'
    edit = site.source.insertion(site.source.root, text)
    return site.defect("DX224", edit, sign="<compiler")


def processing_instruction(site: Site) -> PlantedDefect:
    """The mark of an editor."""
    _, link = site.pick_link(lambda each: True, "link")
    edit = site.source.insertion_after(link, '<?editor fold="on"?>')
    return site.defect("DX423", edit, sign="<?editor")


def quaternion(site: Site) -> PlantedDefect:
    """An orientation as URDF 1.2 writes it, of length 1 or not."""
    size = site.rng.choice([1.0, 2.0])
    parts = [site.rng.uniform(0.2, 1.0) * site.rng.choice([-1.0, 1.0]) for _ in range(4)]
    length = math.hypot(*parts) / size
    words = " ".join(repr(part / length) for part in parts)
    return _with_origin(site, "DX418", f'quat_xyzw="{words}"')


def unreadable_quaternion(site: Site) -> PlantedDefect:
    """A quaternion beside rpy, of three numbers, or with commas."""
    both = 'rpy="0.1 0.2 0.3" quat_xyzw="0 0 0 1"'
    wrong = [both, 'quat_xyzw="0 0 1"', 'quat_xyzw=""', 'quat_xyzw="0,0,1,1"']
    return _with_origin(site, "DX419", site.rng.choice(wrong))


def _with_origin(site: Site, rule: str, orientation: str) -> PlantedDefect:
    """Give a joint that moves another origin, in a robot of URDF 1.2."""
    require_no_version(site)
    require_complete_limits(site)
    joint, element = site.pick_joint(moving, "joint that moves")
    origin, text = element.first("origin"), f'<origin xyz="0.1 0.02 0.3" {orientation}/>'
    source = site.source
    edit = source.insertion(element, text) if origin is None else source.replacement(origin, text)
    version = source.attribute_edit(source.root, "version", "1.2")
    return site.defect(rule, version, edit, joint=joint.name)


PLANTERS = (
    Planter("DX218", axis_misspelled),
    Planter("DX219", axis_of_fixed_joint),
    Planter("DX220", loop_joint),
    Planter("DX221", world_not_declared, ("fixed",)),
    Planter("DX222", incomplete_limit),
    Planter("DX223", second_root),
    Planter("DX224", mujoco_settings),
    Planter("DX227", joint_of_drake),
    Planter("DX423", processing_instruction),
    Planter("DX424", without_geometry),
    Planter("DX418", quaternion),
    Planter("DX419", unreadable_quaternion),
)
