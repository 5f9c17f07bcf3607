"""Elements and attributes of SDF: those that dynx uses, and what it means that others are not read.

The format is that of versions 1.4 to 1.12 (http://sdformat.org/spec). An element that stands in neither table
is misspelt. One whose name has a prefix, such as ``drake:joint``, belongs to a program; those of
`dynx.model.sdf.extension` are used. A ``<plugin>`` may stand anywhere.
"""

from __future__ import annotations

from dynx.model.sdf.extension import GEAR_RATIO, HOLD, LIMITS, LOCKED, NAME, ROTOR_INERTIA

_NONE = "it moves no body"
_LIGHT = "it is not drawn"
_WIND = "no wind blows"
_CONTACT = "friction and contacts are those of the scene"
_FRAME = "no pose may refer to a frame inside of a link or joint"
_SENSOR = "no sensor is read"
_STATE = "the state of the file is not used"
_VISUAL = "it belongs into a <visual>; the shape collides as without it"

USED: dict[str, str] = {
    "sdf": "model world include",
    "world": "model include frame joint gravity physics",
    "model": f"model include frame joint link pose static {NAME}",
    "include": "uri name pose static placement_frame",
    "frame": f"pose {NAME}",
    "link": f"pose inertial collision visual gravity {NAME}",
    "inertial": "mass pose inertia density",
    "inertia": "ixx ixy ixz iyy iyz izz",
    "collision": "pose geometry density",
    "visual": "pose geometry material transparency",
    "geometry": "box capsule cone cylinder ellipsoid empty heightmap image mesh plane polyline sphere",
    "box": "size",
    "sphere": "radius",
    "cylinder": "radius length",
    "capsule": "radius length",
    "cone": "radius length",
    "ellipsoid": "radii",
    "plane": "normal",
    "mesh": "uri scale submesh",
    "material": "diffuse",
    "joint": f"pose parent child axis axis2 {NAME} {HOLD} {LOCKED} {ROTOR_INERTIA} {GEAR_RATIO}",
    "axis": "xyz use_parent_model_frame dynamics limit mimic",
    "dynamics": "damping friction spring_reference spring_stiffness",
    "limit": f"lower upper effort velocity {' '.join(LIMITS.values())}",
    "mimic": "multiplier offset reference",
}
"""Elements that are used, by the element around them."""

USED["axis2"] = USED["axis"]

NOT_USED: dict[str, dict[str, str]] = {
    "sdf": {"actor": "no actor is read", "light": _LIGHT},
    "world": {
        "actor": "no actor is read",
        "atmosphere": _NONE,
        "audio": _NONE,
        "gui": _NONE,
        "light": _LIGHT,
        "magnetic_field": _NONE,
        "population": "no copy of a model is made",
        "road": "it is neither drawn nor touched",
        "scene": _NONE,
        "spherical_coordinates": _NONE,
        "state": _STATE,
        "wind": _WIND,
    },
    "model": {
        "allow_auto_disable": _NONE,
        "enable_wind": _WIND,
        "gripper": "nothing is gripped by it",
        "model_state": _STATE,
        "self_collide": "the scene says which shapes may touch",
    },
    "include": {"model_state": _STATE, "namespace": _NONE},
    "link": {
        "audio_sink": _NONE,
        "audio_source": _NONE,
        "battery": _NONE,
        "contact": f"PyBullet alone has it; {_CONTACT}",
        "enable_wind": _WIND,
        "frame": _FRAME,
        "kinematic": "the link moves as others do",
        "light": _LIGHT,
        "must_be_base_link": "joints say which link is the root",
        "particle_emitter": _LIGHT,
        "projector": _LIGHT,
        "self_collide": "the scene says which shapes may touch",
        "sensor": _SENSOR,
        "velocity_decay": "it brakes no link",
    },
    "inertial": {
        "auto_inertia_params": "they set up the calculation of another program",
        "fluid_added_mass": "it adds no inertia",
        "frame": _FRAME,
    },
    "collision": {
        "auto_inertia_params": "they set up the calculation of another program",
        **dict.fromkeys(("cast_shadows", "material", "meta", "transparency", "visibility_flags"), _VISUAL),
        "frame": _FRAME,
        "laser_retro": _NONE,
        "max_contacts": _CONTACT,
        "surface": _CONTACT,
    },
    "visual": {
        "cast_shadows": _LIGHT,
        "frame": _FRAME,
        "laser_retro": _NONE,
        "meta": _NONE,
        "visibility_flags": _NONE,
    },
    "plane": {"size": "a plane has no end"},
    "mesh": {"convex_decomposition": "a mesh collides as its convex hull"},
    "material": dict.fromkeys(
        (
            "ambient",
            "double_sided",
            "emissive",
            "lighting",
            "pbr",
            "render_order",
            "script",
            "shader",
            "shininess",
            "specular",
        ),
        "the diffuse colour alone is drawn",
    ),
    "joint": {
        "frame": _FRAME,
        "gearbox_ratio": "it is of a gearbox alone",
        "gearbox_reference_body": "it is of a gearbox alone",
        "physics": "it sets up an engine",
        "screw_thread_pitch": "it is of a screw joint alone",
        "sensor": _SENSOR,
        "thread_pitch": "it is of a screw joint alone",
    },
    "axis": {"initial_position": _STATE},
    "limit": dict.fromkeys(("cfm", "dissipation", "erp", "stiffness"), "it sets up the stop of an engine"),
}
"""What it means that an element is not used, by the element around it and by its name."""

NOT_USED["axis2"] = NOT_USED["axis"]

ATTRIBUTES: dict[str, str] = {
    "sdf": "version",
    "world": "name",
    "model": "name canonical_link placement_frame",
    "include": "merge",
    "frame": "name attached_to",
    "link": "name",
    "inertial": "auto",
    "collision": "name",
    "visual": "name",
    "joint": "name type",
    "pose": "relative_to frame rotation_format degrees",
    "xyz": "expressed_in",
    "mimic": "joint axis",
}
"""Attributes that are used, by their element."""

ATTRIBUTES_NOT_USED: dict[str, dict[str, str]] = {
    "model": {"namespace": _NONE},
    "collision": {"concave": "PyBullet alone has it; a mesh collides as its convex hull"},
    "mesh": {"optimization": "a mesh collides as its convex hull"},
}
"""What it means that an attribute is not used, by its element and its name."""

CLOSED = frozenset(("empty", "heightmap", "image", "polyline", "submesh", "physics"))
"""Elements that are used as a whole: what stands in them is not looked at."""

TEXTS = frozenset(
    word
    for words in USED.values()
    for word in words.split()
    if word not in USED and word not in CLOSED and word not in ("axis", "axis2")
) | {"gravity", "name"}
"""Elements whose text is used."""

OPAQUE = frozenset(("plugin", "sensor", "gui", "scene", "state", "actor", "population"))
"""Elements whose content is not stored."""
