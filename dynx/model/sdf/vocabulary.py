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
    "plane": "normal size",
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

IN_NOT_USED: dict[str, str] = {
    "accel": "bias_mean bias_stddev mean stddev",
    "air_pressure": "pressure reference_altitude",
    "air_speed": "pressure",
    "altimeter": "vertical_position vertical_velocity",
    "angular_velocity": "x y z",
    "atmosphere": "pressure temperature temperature_gradient",
    "attenuation": "constant linear quadratic range",
    "audio": "device",
    "audio_source": "contact frame gain loop pitch pose uri",
    "battery": "voltage",
    "blend": "fade_dist min_height",
    "bounce": "restitution_coefficient threshold",
    "bullet": (
        "constraints fdir1 friction friction2 kd kp rolling_friction soft_cfm soft_erp solver "
        "split_impulse split_impulse_penetration_threshold"
    ),
    "camera": (
        "box_type camera_info_topic clip depth_camera distortion frame horizontal_fov image lens "
        "noise optical_frame_id pose projection_type save segmentation_type track_visual "
        "trigger_topic triggered view_controller visibility_mask"
    ),
    "clip": "far near",
    "collision_engine": "bullet ode",
    "constraints": (
        "cfm contact_max_correcting_vel contact_surface_layer erp split_impulse "
        "split_impulse_penetration_threshold"
    ),
    "contact": (
        "bullet category_bitmask collide_bitmask collide_without_contact "
        "collide_without_contact_bitmask collision dissipation dynamic_friction elastic_modulus ode "
        "override_impact_capture_velocity override_stiction_transition_velocity "
        "plastic_coef_restitution plastic_impact_velocity poissons_ratio static_friction stiffness "
        "topic viscous_friction"
    ),
    "convex_decomposition": "max_convex_hulls voxel_resolution",
    "custom_function": "c1 c2 c3 f fun",
    "dart": "bone_attachment collision_detector damping flesh_mass_fraction solver stiffness",
    "depth_camera": "clip output",
    "distortion": "center k1 k2 k3 p1 p2",
    "fluid_added_mass": "pp pq pr qq qr rr xp xq xr xx xy xz yp yq yr yy yz zp zq zr zz",
    "force": "x y z",
    "force_torque": "force frame measure_direction torque",
    "friction": "bullet ode torsional",
    "gps": "position_sensing velocity_sensing",
    "grasp_check": "attach_steps detach_steps min_contact_count",
    "gripper": "grasp_check gripper_link palm_link",
    "heightmap": "blend pos sampling size texture uri use_terrain_paging",
    "horizontal": "max_angle min_angle noise resolution samples",
    "image": "anti_aliasing format granularity height scale threshold uri width",
    "imu": "angular_velocity enable_orientation linear_acceleration noise orientation_reference_frame topic",
    "intrinsics": "cx cy fx fy s",
    "lens": "custom_function cutoff_angle env_texture_size intrinsics projection scale_to_hfov type",
    "lidar": "noise range scan visibility_mask",
    "light": (
        "attenuation cast_shadows diffuse direction frame intensity light_on pose specular spot visualize"
    ),
    "linear_acceleration": "x y z",
    "logical_camera": "aspect_ratio far horizontal_fov near",
    "magnetometer": "x y z",
    "meta": "layer",
    "metal": (
        "albedo_map ambient_occlusion_map emissive_map environment_map light_map metalness "
        "metalness_map normal_map roughness roughness_map"
    ),
    "navsat": "position_sensing velocity_sensing",
    "noise": (
        "accel bias_mean bias_stddev dynamic_bias_correlation_time dynamic_bias_stddev mean precision "
        "rate stddev type"
    ),
    "ode": (
        "bounce cfm cfm_damping constraints erp fdir1 fudge_factor implicit_spring_damper kd kp limit "
        "max_force max_vel min_depth mu mu2 provide_feedback slip slip1 slip2 soft_cfm soft_erp "
        "solver suspension velocity"
    ),
    "orientation_reference_frame": "custom_rpy grav_dir_x localization",
    "particle_emitter": (
        "color_end color_range_image color_start duration emitting lifetime material max_velocity "
        "min_velocity particle_scatter_ratio particle_size pose rate scale_rate size topic"
    ),
    "pbr": "metal specular",
    "physics": (
        "bullet dart gravity magnetic_field max_contacts max_step_size ode provide_feedback "
        "real_time_factor real_time_update_rate simbody"
    ),
    "polyline": "height point",
    "position_sensing": "horizontal vertical",
    "pressure": "noise",
    "projection": "p_cx p_cy p_fx p_fy tx ty",
    "projector": "far_clip fov frame near_clip pose texture visibility_flags",
    "range": "max min resolution",
    "rate": "bias_mean bias_stddev mean stddev",
    "ray": "noise range scan visibility_mask",
    "save": "path",
    "scan": "horizontal vertical",
    "script": "auto_start delay_start loop name trajectory uri",
    "sensor": (
        "air_pressure air_speed altimeter always_on camera contact enable_metrics force_torque frame "
        "frame_id gps imu lidar logical_camera magnetometer navsat pose ray rfid rfidtag sonar topic "
        "transceiver update_rate visualize"
    ),
    "shader": "normal_map",
    "simbody": "accuracy contact max_transient_velocity min_step_size must_be_loop_joint",
    "soft_contact": "dart",
    "solver": (
        "friction_model island_threads iters min_step_size precon_iters solver_type sor "
        "thread_position_correction type use_dynamic_moi_rescaling"
    ),
    "sonar": "geometry max min radius",
    "specular": (
        "albedo_map ambient_occlusion_map emissive_map environment_map glossiness glossiness_map "
        "light_map normal_map specular_map"
    ),
    "spherical_coordinates": (
        "elevation heading_deg latitude_deg longitude_deg surface_axis_equatorial surface_axis_polar "
        "surface_model world_frame_orientation"
    ),
    "spot": "falloff inner_angle outer_angle",
    "submesh": "center name",
    "surface": "bounce contact friction soft_contact",
    "suspension": "cfm erp",
    "texture": "diffuse normal size",
    "torque": "x y z",
    "torsional": "coefficient ode patch_radius surface_radius use_patch_radius",
    "track_visual": "inherit_yaw max_dist min_dist name static use_model_frame xyz",
    "transceiver": "essid frequency gain max_frequency min_frequency power sensitivity",
    "velocity_decay": "angular linear",
    "velocity_sensing": "horizontal vertical",
    "vertical": "max_angle min_angle noise resolution samples",
    "vertical_position": "noise",
    "vertical_velocity": "noise",
    "wind": "linear_velocity",
    "x": "noise",
    "y": "noise",
    "z": "noise",
}
"""Elements that any version of SDF has inside of one that is not used, by its name."""

_NOT_IN_SDF = {
    "link": ("contact",),
    "collision": ("cast_shadows", "material", "meta", "transparency", "visibility_flags"),
}
"""Elements of `NOT_USED` that SDF has not, by the element around them."""


def is_undefined(around: str, name: str, version: tuple[int, int]) -> bool:
    """Check whether a version of SDF lacks an element in another one; False where this is not known."""
    if name == "plugin" or ":" in name:
        return False
    if version >= (1, 7) and (
        name == "use_parent_model_frame" or (name == "frame" and around not in ("model", "world"))
    ):
        return True  # These elements are of older versions.
    if around in USED:
        known = [*USED[around].split(), *NOT_USED.get(around, {})]
        return name not in known or name in _NOT_IN_SDF.get(around, ())
    return around in IN_NOT_USED and name not in IN_NOT_USED[around].split()


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
