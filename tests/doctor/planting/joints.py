"""Planters of DX2: defects of joints."""

from __future__ import annotations

from dynx.model.elements import Joint
from tests.doctor.planting.inertia import ZERO, has_link
from tests.doctor.planting.site import CannotPlant, PlantedDefect, Planter, Site

TURNING = ("revolute", "continuous")
SINGLE = (*TURNING, "prismatic")


def axis_not_unit(site: Site) -> PlantedDefect:
    """An axis of the wrong length, or rounded to six digits."""
    joint, element = site.pick_joint(moving, "joint that moves")
    factor = site.rng.choice([2.0, -1.5, 10.0, 0.5, 1.000001, 0.999998])
    words = " ".join(f"{factor * value + 0.0:.9g}" for value in joint.axis)
    return site.defect("DX201", *site.part_edits(element, "axis", xyz=words), joint=joint.name)


def axis_nearly_aligned(site: Site) -> PlantedDefect:
    """A coordinate axis with the noise of a CAD program."""
    joint, element = site.pick_joint(
        lambda each: moving(each) and max(each.axis) == 1.0, "joint that moves along a coordinate axis"
    )
    noise = [site.rng.choice([1e-8, -4.2e-9, 1.2e-10, 6e-11, -1e-11]) for _ in range(3)]
    pairs = zip(joint.axis, noise, strict=True)
    words = " ".join(f"{1.0 if value == 1.0 else error:g}" for value, error in pairs)
    return site.defect("DX226", *site.part_edits(element, "axis", xyz=words), joint=joint.name)


def axis_without_direction(site: Site) -> PlantedDefect:
    """The zero axis that exporters write for fixed joints."""
    joint, element = site.pick_joint(moving, "joint that moves")
    words = site.rng.choice(["0 0 0", "0.0 0.0 0.0", ""])
    return site.defect("DX202", *site.part_edits(element, "axis", xyz=words), joint=joint.name)


def without_limit(site: Site) -> PlantedDefect:
    """The limit forgotten, or commented out."""
    joint, element = site.pick_joint(limited, "joint with a limit")
    limit = element.first("limit")
    assert limit is not None
    text = site.source.data[limit.span.start : limit.span.end].decode()
    plain = site.rng.random() < 0.5 or "--" in text
    edit = site.source.removal(limit) if plain else site.source.replacement(limit, f"<!-- {text} -->")
    return site.defect("DX203", edit, joint=joint.name)


def without_effort(site: Site) -> PlantedDefect:
    """A limit without effort or velocity."""
    require_no_version(site)
    joint, element = site.pick_joint(limited, "joint with a limit")
    limit = element.first("limit")
    assert limit is not None
    names = [name for name in ("effort", "velocity") if name in limit.attributes]
    gone = names if site.rng.random() < 0.5 else [site.pick(names, "effort or velocity")]
    edits = [site.source.attribute_removal(limit, name) for name in gone]
    return site.defect("DX204", *edits, joint=joint.name)


def limits_exchanged(site: Site) -> PlantedDefect:
    """Lower and upper the wrong way round."""
    joint, element = site.pick_joint(
        lambda each: limited(each) and each.limits.lower < each.limits.upper, "joint with room"
    )
    limit = element.first("limit")
    assert limit is not None
    lower, upper = (limit.attributes.get(name, "0") for name in ("lower", "upper"))
    edits = site.part_edits(element, "limit", lower=upper, upper=lower)
    return site.defect("DX205", *edits, joint=joint.name)


def negative_effort(site: Site) -> PlantedDefect:
    """-1 for "no limit", or a wrong sign."""
    joint, element = site.pick_joint(limited, "joint with a limit")
    limit = element.first("limit")
    assert limit is not None
    name = site.rng.choice(["effort", "velocity"])
    old = limit.attributes.get(name, "0").strip()
    wanted = "-1" if float(old) == 0.0 or site.rng.random() < 0.5 else f"-{old}"
    return site.defect("DX206", *site.part_edits(element, "limit", **{name: wanted}), joint=joint.name)


def safety_without_gain(site: Site) -> PlantedDefect:
    """Soft limits without the gain that URDF requires."""
    joint, element = site.pick_joint(moving, "joint that moves")
    text = '<safety_controller soft_lower_limit="-1.5" soft_upper_limit="1.5" k_position="15"/>'
    return site.defect("DX207", site.source.insertion(element, text), joint=joint.name)


def mimic_of_nothing(site: Site) -> PlantedDefect:
    """A mimic whose joint is misspelled, absent, or the joint itself."""
    joint, element = site.pick_joint(moving, "joint that moves")
    words = site.rng.choice([f'joint="{joint.name}_left"', 'joint="gripper_finger"', f'joint="{joint.name}"'])
    text = f'<mimic {words} multiplier="1" offset="0"/>'
    return site.defect("DX208", site.source.insertion(element, text), joint=joint.name)


def mimic_of_fixed(site: Site) -> PlantedDefect:
    """A mimic whose joint is fixed."""
    joint, element = site.pick_joint(moving, "joint that moves")
    followed, _ = site.pick_joint(lambda each: each.type == "fixed", "fixed joint")
    offset = site.rng.choice(["0", "0.1"])
    text = f'<mimic joint="{followed.name}" multiplier="1" offset="{offset}"/>'
    return site.defect(
        "DX209", site.source.insertion(element, text), joint=joint.name, touched=[followed.name]
    )


def several_freedoms(site: Site) -> PlantedDefect:
    """A ball joint or the like, which some readers know; a floating one below an empty root is DX211."""
    joint, element = site.pick_joint(moving, "joint that moves")
    below_mount = joint.parent == site.model.root and site.skeleton.mass(joint.parent) == 0.0
    kind = site.rng.choice(["spherical", "planar", *([] if below_mount else ["floating"])])
    return site.defect(
        "DX210", site.source.attribute_edit(element, "type", kind), joint=joint.name, touched=[joint.child]
    )


def floating_at_root(site: Site) -> PlantedDefect:
    """A frame that carries the robot by a floating joint: a floating base.

    A root named world would be a second defect below another root, and so would one without mass on
    a joint that is not fixed.
    """
    root = site.model.root
    if not site.free(root) or root == "world":
        raise CannotPlant("the root is taken, or is the world")
    if not any(site.skeleton.mass(each) > 0.0 for each in site.skeleton.rigid_group(root)):
        raise CannotPlant("nothing at the root has mass")
    name = site.rng.choice(["odom", "map", "ground"])
    if has_link(site, name):
        raise CannotPlant(f"has a link {name}")
    edit = site.source.insertion(
        site.source.root,
        f'<link name="{name}">\n{ZERO}</link>\n<joint name="free_joint" type="floating">\n'
        f'  <parent link="{name}"/>\n  <child link="{root}"/>\n</joint>',
        first=True,
    )
    return site.defect("DX211", edit, joint="free_joint", touched=[root, name])


def too_many(site: Site) -> PlantedDefect:
    """A skin of sensors, each with a frame of its own."""
    parent, _ = site.pick_link(lambda each: site.skeleton.mass(each) > 0.0, "heavy link")
    missing = 128 + site.rng.randint(0, 3) - len(site.source.root.all("joint"))
    parts = [
        f'<link name="taxel_{k}">\n{ZERO}</link>\n<joint name="taxel_{k}_fixed" type="fixed">\n'
        f'  <origin xyz="0.01 0 {k}e-3" rpy="0 0 0"/>\n'
        f'  <parent link="{parent}"/>\n  <child link="taxel_{k}"/>\n</joint>'
        for k in range(missing)
    ]
    edit = site.source.insertion(site.source.root, "\n".join(parts))
    return site.defect("DX212", edit, touched=[parent], sign="taxel_")


def named_universe(site: Site) -> PlantedDefect:
    """A joint named universe that carries a payload."""
    skeleton = site.skeleton
    parent, _ = site.pick_link(
        lambda each: skeleton.moves(each) and skeleton.ranks[each] > 0 and skeleton.mass(each) > 1e-3,
        "heavy link that turns",
    )
    if has_link(site, "payload"):
        raise CannotPlant("has a payload")
    mass = round(skeleton.mass(parent) * site.rng.uniform(0.1, 0.5), 6)
    moment = f"{mass * 0.01:.6g}"
    inertial = (
        f'  <inertial>\n    <origin xyz="0.01 0.02 0.03" rpy="0 0 0"/>\n    <mass value="{mass}"/>\n'
        f'    <inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/>\n'
        "  </inertial>\n"
    )
    edit = site.link_insertion("payload", parent, inertial=inertial, joint="universe")
    return site.defect("DX213", edit, joint="universe", touched=[parent, "payload"])


def transmission_of_nothing(site: Site) -> PlantedDefect:
    """A transmission without actuator, or with an unknown joint."""
    joint, _ = site.pick_joint(moving, "joint that moves")
    if site.rng.random() < 0.5:
        inside = f'  <joint name="{joint.name}"/>'
    else:
        inside = f'  <joint name="{joint.name}_old"/>\n  <actuator name="motor_of_{joint.name}"/>'
    text = transmission(f"drive_of_{joint.name}", inside)
    edit = site.source.insertion(site.source.root, text)
    return site.defect("DX214", edit, touched=[joint.name], sign=f"drive_of_{joint.name}")


def actuator_twice(site: Site) -> PlantedDefect:
    """A transmission copied, and its joint alone changed."""
    first, _ = site.pick_joint(driven, "joint that moves")
    second, _ = site.pick_joint(lambda each: driven(each) and each is not first, "second joint that moves")
    text = "\n".join(
        transmission(f"twin_{k}", f'  <joint name="{joint.name}"/>\n  <actuator name="twin_motor"/>')
        for k, joint in enumerate((first, second))
    )
    edit = site.source.insertion(site.source.root, text)
    return site.defect("DX215", edit, touched=[first.name, second.name], sign="twin_motor")


def upper_missing(site: Site) -> PlantedDefect:
    """A range without upper limit, most of which is outside the range that PyBullet reads."""
    require_no_version(site)
    joint, element = site.pick_joint(lambda each: limited(each) and each.moves, "joint with a limit")
    lower = site.rng.choice(["-1", "-1.0", "-1.05", "-1.1"])
    edits = site.part_edits(element, "limit", lower=lower)
    limit = element.first("limit")
    if limit is not None and "upper" in limit.attributes:
        edits.append(site.source.attribute_removal(limit, "upper"))
    return site.defect("DX216", *edits, joint=joint.name)


def named_root_joint(site: Site) -> PlantedDefect:
    """The joint that carries the robot's first body named as what it is."""
    joint, _ = site.pick_joint(moving, "joint that moves")
    if any(each.name == "root_joint" for each in site.model.joints):
        raise CannotPlant("has a root_joint")
    edits = site.rename_edits("joint", joint.name, "root_joint")
    return site.defect("DX217", *edits, joint="root_joint", touched=[joint.name, joint.child])


def transmission(name: str, inside: str) -> str:
    """Write a ``<transmission>`` of the usual type."""
    kind = "<type>transmission_interface/SimpleTransmission</type>"
    return f'<transmission name="{name}">\n  {kind}\n{inside}\n</transmission>'


def require_no_version(site: Site) -> None:
    """Raise CannotPlant in a robot that states a version: what its limits need is another in URDF 1.2."""
    if "version" in site.source.root.attributes:
        raise CannotPlant("has a version")


def require_complete_limits(site: Site) -> None:
    """Raise CannotPlant where a limit lacks what one version of URDF needs, for a plan to state another."""
    limits = [limit for joint in site.source.root.all("joint") for limit in joint.all("limit")]
    if not all({"lower", "upper", "effort", "velocity"} <= limit.attributes.keys() for limit in limits):
        raise CannotPlant("has an incomplete limit")


def moving(joint: Joint) -> bool:
    """Check that the joint has a coordinate."""
    return joint.type in SINGLE and joint.moves


def driven(joint: Joint) -> bool:
    """Check that a motor can move it: Drake makes no actuator for an effort limit of 0."""
    return moving(joint) and joint.limits.effort > 0.0


def limited(joint: Joint) -> bool:
    """Check that URDF requires a limit."""
    return joint.type in ("revolute", "prismatic")


PLANTERS = (
    Planter("DX201", axis_not_unit),
    Planter("DX202", axis_without_direction),
    Planter("DX203", without_limit),
    Planter("DX204", without_effort),
    Planter("DX205", limits_exchanged),
    Planter("DX206", negative_effort),
    Planter("DX207", safety_without_gain),
    Planter("DX208", mimic_of_nothing),
    Planter("DX209", mimic_of_fixed),
    Planter("DX210", several_freedoms),
    Planter("DX211", floating_at_root, ("fixed",)),
    Planter("DX212", too_many),
    Planter("DX213", named_universe),
    Planter("DX214", transmission_of_nothing),
    Planter("DX215", actuator_twice),
    Planter("DX216", upper_missing),
    Planter("DX217", named_root_joint, ("floating",)),
    Planter("DX226", axis_nearly_aligned),
)
