"""Names of engines, roboticstoolbox and Gymnasium, and the calls of dynx that do the same.

Who knows an engine types its names first: `World.stepSimulation`, `dynx.rnea`, `model.getNumJoints`. The
AttributeError of dynx's classes and packages then names dynx's own call, or else the nearest name
(`explained`), and the page for those who come from that library. So it is with arguments such as
`timestep`, `qpos` and `mu` (`keyword_of_dynx`). Names of quantities are those of the table of quantities; the
others stand here. The tables of the pages "Coming from" are written from both.
"""

from __future__ import annotations

from collections.abc import Iterable

from dynx import errors
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.errors import nearest, shown

_JOINT_LIMITS = "Model.joint(name), which has limits, axis and dynamics"
_MOTORS = (
    "World.step(motors={robot: dynx.PDMotor(...)}), or with TorqueMotor, PositionMotor or VelocityMotor; "
    "World.step(torques={robot: tau}); in dynx.simulate a controller of dynx.control, such as OpenLoop with "
    "a table of torques"
)
_POSITIONS, _VELOCITIES = "World.state.robots[name].q", "World.state.robots[name].v"
_STATE = f"{_POSITIONS} and {_VELOCITIES}"
_POSE_OF_BODY = f"World.state.bodies[name].T_world_body of a body; {_POSITIONS}[:7] of a floating base"
_SET_STATE = "World.set_state(...), or SceneRobot(q=..., v=...) at the start"
_SHAPES = "dynx.world.box, sphere, cylinder, capsule or mesh, for a body in Scene(bodies=...)"
_SWITCH = "World.set_active(name, active), with the name of the constraint"
_CONSTRAINT = (
    "dynx.world.PointToPoint or Weld, in Scene(constraints=...); with active=False, World.set_active(name) "
    "switches it on during a run"
)
_FORCE = "dynx.ExternalForce(part, wrench), in World.step(forces=[...])"
_CAMERA = "World.camera(dynx.world.Camera(...))"
_WHOLE_STEP = "World.step(torques={robot: tau}), which does mj_step1 and mj_step2 together"
_FILES = "dynx.load(path) for a robot in URDF or xacro, and dynx.world.read_scene(path) for a scene"
_SAVE = "World.save(), or World.write(path) for a file"
_CLOSE = "World.close(), or a with block"
_START = "World(scene, engine='pybullet'), without a window; World.view shows the world"
_SETTINGS = "an argument of World(scene, ...), such as `dt`, `substeps` or a setting of the engine"
_LOADED = "dynx.load(path)"
_EULER = "roll, pitch, yaw [rad]"
_WITH_ARMATURE = "Backend.mass_matrix(q, joint_dynamics=True)"
_TORQUE = "Backend.inverse_dynamics(q, v, a, joint_dynamics=True)"
_ACCELERATION = "Backend.forward_dynamics(q, v, tau, joint_dynamics=True)"

PYBULLET = {
    "addUserDebugLine": "`viewer.line(...)`, where `viewer` is World.view()",
    "addUserDebugParameter": "`viewer.slider(...)`, where `viewer` is World.view()",
    "addUserDebugText": "`viewer.text(...)`, where `viewer` is World.view()",
    "applyExternalForce": _FORCE,
    "applyExternalTorque": _FORCE,
    "calculateInverseKinematics": "Backend.inverse_kinematics(pose, frame)",
    "calculateInverseKinematics2": "Backend.inverse_kinematics({frame: pose, ...})",
    "changeConstraint": "a Scene with the changed constraint, in a new World",
    "changeDynamics": "friction: dynx.world.Material of a body or a link, in the Scene; damping of joints: "
    "<dynamics> in the URDF for a World, `joint_damping` in dynx.simulate; masses: `mass_scale` and "
    "`payload` in dynx.simulate; damping of links: `link_damping`, a setting of World",
    "computeProjectionMatrixFOV": _CAMERA,
    "computeViewMatrix": _CAMERA,
    "computeViewMatrixFromYawPitchRoll": _CAMERA,
    "connect": _START,
    "createCollisionShape": _SHAPES,
    "createConstraint": _CONSTRAINT,
    "createMultiBody": _SHAPES,
    "createVisualShape": _SHAPES,
    "disconnect": _CLOSE,
    "enableJointForceTorqueSensor": "World(scene, keep_last_step=True), then World.joint_wrenches()",
    "getAABB": "World.aabb(part)",
    "getBasePositionAndOrientation": _POSE_OF_BODY,
    "getBaseVelocity": f"World.state.bodies[name].twist of a body; {_VELOCITIES}[:6] of a floating base",
    "getBodyInfo": "Scene.robots and Scene.bodies",
    "getCameraImage": _CAMERA,
    "getClosestPoints": "World.closest_points(a, b)",
    "getContactPoints": "World.contacts(part)",
    "getDynamicsInfo": "Model.link(name), which has the inertial data of the link",
    "getEulerFromQuaternion": f"dynx.rpy_from_quat(quat_xyzw): {_EULER}",
    "getJointInfo": _JOINT_LIMITS,
    "getJointState": f"{_STATE}; Backend.joint_wrenches(q, v, a) for the reaction force",
    "getJointStateMultiDof": _STATE,
    "getJointStates": _STATE,
    "getLinkState": "Backend.forward_kinematics(q, frame), and Backend.frame_velocity(q, v, frame)",
    "getLinkStates": "Backend.forward_kinematics(q, frames)",
    "getMatrixFromQuaternion": "dynx.rotation_from_quat(quat_xyzw)",
    "getNumBodies": "Scene.robots and Scene.bodies",
    "getNumJoints": "`len(Model.joints)`, with fixed joints; Model.joint_names has no fixed, mimic or "
    "locked joints",
    "getOverlappingObjects": "World.overlapping(lower, upper)",
    "getPhysicsEngineParameters": "World.options and World.settings",
    "getQuaternionFromEuler": f"dynx.quat_from_rpy(rpy): {_EULER}, result x, y, z, w",
    "getVisualShapeData": "Model.geometry",
    "invertTransform": "numpy.linalg.inv(T) for a pose (4, 4); `R.T` for a rotation (3, 3)",
    "loadMJCF": "dynx.load(path) for a robot, dynx.world.read_scene(path) for a scene; Model.to_mjcf and "
    "World.to_mjcf write MJCF",
    "loadSDF": "dynx.load(path) for a robot",
    "loadURDF": f"{_LOADED}, and dynx.world.SceneRobot(name, model) in a Scene",
    "multiplyTransforms": "`T_AB @ T_BC`, with poses (4, 4)",
    "rayTest": "World.cast_rays(origins, directions)",
    "rayTestBatch": "World.cast_rays(origins, directions)",
    "removeBody": "a Scene without the body, in a new World",
    "removeConstraint": _SWITCH,
    "resetBasePositionAndOrientation": _SET_STATE,
    "resetBaseVelocity": _SET_STATE,
    "resetDebugVisualizerCamera": "`viewer.look_from(dynx.world.Camera.look_at(...))`, where `viewer` is "
    "World.view()",
    "resetJointState": _SET_STATE,
    "resetJointStateMultiDof": _SET_STATE,
    "resetSimulation": "World.reset()",
    "restoreState": "World.restore(snapshot)",
    "saveBullet": _SAVE,
    "saveState": _SAVE,
    "setAdditionalSearchPath": "dynx.load(path, package_dirs=[...]); dynx.load('r2d2.urdf') finds this "
    "file of pybullet_data without `package_dirs`",
    "setCollisionFilterGroupMask": "Scene.ignored, the pairs of parts that do not collide",
    "setCollisionFilterPair": "Scene.ignored, the pairs of parts that do not collide; for the ends of a Weld "
    "while it acts, its `collides=False`",
    "setGravity": "`gravity=(0, 0, -9.81)`, an argument of Scene and of dynx.load",
    "setJointMotorControl": _MOTORS,
    "setJointMotorControl2": _MOTORS,
    "setJointMotorControlArray": _MOTORS,
    "setJointMotorControlMultiDof": _MOTORS,
    "setPhysicsEngineParameter": _SETTINGS,
    "setRealTimeSimulation": "World.run(duration, real_time=True)",
    "setTimeStep": "World(scene, dt=0.001)",
    "startStateLogging": "dynx.world.Record of a World, or the rollout of dynx.simulate",
    "stepSimulation": "World.step()",
}
"""Functions of PyBullet, with what does the same in dynx."""

_LOCAL = "for `pin.LOCAL`"

PINOCCHIO = {
    "FromDynamicParameters": "`dynx.model.Inertial.from_parameters(parameters)`, for "
    "Model.with_inertials({link: inertial}); the parameters have another order",
    "SE3": "a pose (4, 4), such as `dynx.Pose(xyz, rpy).matrix`",
    "RobotWrapper": "dynx.backend('pinocchio', dynx.load(path))",
    "buildModelFromUrdf": _LOADED,
    "buildModelsFromUrdf": _LOADED,
    "ccrba": "Backend.centroidal_momentum(q, v)",
    "computeABADerivatives": "dynx.Derivatives",
    "computeAllTerms": "the methods of Backend, such as Backend.mass_matrix(q) and Backend.bias_torque(q, v)",
    "computeForwardKinematicsDerivatives": (
        "dynx.Derivatives.forward_kinematics_derivative(q, frame) for the derivative of a pose by q. "
        "Backend.jacobian(q, frame) for the derivative of a velocity by v. dynx has no call for the "
        "derivatives of velocities and accelerations by q"
    ),
    "computeFrameJacobian": f"Backend.jacobian(q, frame, reference='local') {_LOCAL}, the default of "
    "Pinocchio",
    "computeJointJacobian": "Backend.jacobian(q, link, reference='local') for the child link of the joint",
    "computeJointJacobians": "Backend.jacobian(q, link, reference='world') for the child link of each joint",
    "computeMinverse": "numpy.linalg.inv(Backend.mass_matrix(q)); for the acceleration itself, "
    "Backend.forward_dynamics(q, v, tau)",
    "computeRNEADerivatives": "dynx.Derivatives",
    "computeSupportedForceByFrame": (
        "Backend.joint_wrenches(q, v, a), which includes the load of the child body of the joint"
    ),
    "computeTotalMass": "Model.total_mass",
    "difference": "Model.difference(q0, q1)",
    "exp6": "Model.integrate(q, v) moves a floating base along the exponential of its twist",
    "forwardKinematics": "Backend.forward_kinematics(q, frame)",
    "getFrameId": "no such call, because calls of dynx take the name of a frame; Model.frame_names lists the "
    "names",
    "getFrameClassicalAcceleration": "Backend.frame_acceleration(q, v, a, frame) for "
    "`pin.LOCAL_WORLD_ALIGNED`",
    "getFrameJacobian": f"Backend.jacobian(q, frame, reference='local') {_LOCAL}",
    "getFrameJacobianTimeVariation": f"Backend.jacobian_derivative(q, v, frame, reference='local') {_LOCAL}",
    "getFrameVelocity": f"Backend.frame_velocity(q, v, frame, reference='local') {_LOCAL}, the default of "
    "Pinocchio",
    "getJointId": "no such call, because calls of dynx take the name of a joint; Model.joint_names lists the "
    "names",
    "getJointJacobian": "Backend.jacobian(q, link, reference='local') for the child link of the joint and "
    "`pin.LOCAL`",
    "integrate": "Model.integrate(q, v)",
    "log3": "`scipy.spatial.transform.Rotation.from_matrix(R).as_rotvec()`",
    "log6": "Model.difference(q0, q1), whose first six entries are `log6(T0.inverse() * T1)` for two poses "
    "T0 and T1 of a floating base",
    "neutral": "Model.neutral()",
    "randomConfiguration": "Model.random(rng)",
    "toDynamicParameters": "dynx.inertial_parameters(model), ten numbers per link in another order",
    "updateFramePlacement": "Backend.forward_kinematics(q, frame)",
    "updateFramePlacements": "Backend.forward_kinematics(q)",
}
"""Functions of Pinocchio, besides those of quantities."""

_FIXED = "no such call, because a mocap body is fixed in a Scene; World.set_state(...) moves a free body"
_FORCES_OF_ACTUATORS = "Model.actuator_forces(ctrl, q, v)"

MUJOCO = {
    "eq_active": _SWITCH,
    "MjData": "World(scene, engine='mujoco'), whose state is World.state",
    "MjModel": f"{_LOADED} for a robot; for a scene World(scene, engine='mujoco'), where `scene` is "
    "dynx.world.read_scene(path)",
    "actuator": "Model.actuators, which have names, gears, gains, biases and ranges",
    "ctrl": f"{_FORCES_OF_ACTUATORS}, for World.step(torques={{robot: tau}}) or the method `torque` of a "
    "controller or task",
    "mj_applyFT": _FORCE,
    "mj_contactForce": "World.contacts(part), which returns contacts with their forces",
    "mj_crb": _WITH_ARMATURE,
    "mj_differentiatePos": "Model.difference(q0, q1)",
    "mj_energyPos": "Backend.potential_energy(q, joint_dynamics=True)",
    "mj_energyVel": "Backend.kinetic_energy(q, v, joint_dynamics=True)",
    "mj_forward": f"{_ACCELERATION}, without limits and contacts",
    "mj_fullM": _WITH_ARMATURE,
    "mj_geomDistance": "World.closest_points(a, b)",
    "mj_getTotalmass": "Model.total_mass",
    "mj_integratePos": "Model.integrate(q, v)",
    "mj_inverse": f"{_TORQUE}, without limits and contacts",
    "mj_jacBody": "Backend.jacobian(q, frame)",
    "mj_jacSite": "Backend.jacobian(q, frame)",
    "mj_name2id": "no such call, because calls of dynx take the name of a part",
    "mj_ray": "World.cast_rays(origins, directions)",
    "mj_resetData": "World.reset()",
    "mj_rne": "Backend.inverse_dynamics(q, v, a)",
    "mj_saveLastXML": "World.to_mjcf() or Model.to_mjcf()",
    "mj_step": "World.step()",
    "mj_step1": _WHOLE_STEP,
    "mj_step2": _WHOLE_STEP,
    "mocap_pos": _FIXED,
    "mocap_quat": _FIXED,
    "nu": "`len(Model.actuators)`",
    "qfrc_actuator": _FORCES_OF_ACTUATORS,
    "qfrc_applied": "World.step(torques={robot: tau})",
    "qpos": f"{_POSITIONS}; {_SET_STATE}",
    "qvel": f"{_VELOCITIES}; {_SET_STATE}",
    "sensordata": "World.read_sensors(), which reads Scene(sensors=...); Model.sensors has those of the file "
    "as data",
    "xfrc_applied": _FORCE,
}
"""Functions, classes and arrays of MuJoCo, besides those of quantities."""

DRAKE = {
    "AdvanceTo": "World.run(duration)",
    "CalcBiasSpatialAcceleration": "`Backend.jacobian_derivative(q, v, frame) @ v`",
    "CalcBiasTerm": "Backend.bias_torque(q, v), which also includes gravity",
    "CalcGravityGeneralizedForces": "Backend.gravity_torque(q), with the opposite sign",
    "CalcInverseDynamics": f"{_TORQUE}; both include armature, and dynx also includes gravity, damping, dry "
    "friction and springs",
    "CalcKineticEnergy": "Backend.kinetic_energy(q, v, joint_dynamics=True)",
    "CalcMassMatrix": _WITH_ARMATURE,
    "CalcMassMatrixViaInverseDynamics": _WITH_ARMATURE,
    "CalcPoseInWorld": "Backend.forward_kinematics(q, frame)",
    "CalcPotentialEnergy": "Backend.potential_energy(q, joint_dynamics=True)",
    "CalcRelativeTransform": "`numpy.linalg.inv(T_WA) @ T_WB`, with both poses by "
    "Backend.forward_kinematics(q, frame)",
    "CalcSpatialMomentumInWorldAboutPoint": "Backend.centroidal_momentum(q, v), about the centre of mass",
    "CalcTotalMass": "Model.total_mass",
    "EvalBodyPoseInWorld": "Backend.forward_kinematics(q, frame)",
    "EvalBodySpatialVelocityInWorld": "Backend.frame_velocity(q, v, frame)",
    "GetJointByName": _JOINT_LIMITS,
    "GetPositions": _POSITIONS,
    "GetVelocities": _VELOCITIES,
    "InverseDynamicsController": "dynx.control.ComputedTorque(model, kp=kp, kd=kd), which has no "
    "integral gain",
    "InverseKinematics": "Backend.inverse_kinematics(pose, frame)",
    "MultibodyPlant": "dynx.backend('drake', model) for its dynamics, or World(scene, engine='drake')",
    "SetPositions": _SET_STATE,
    "SetVelocities": _SET_STATE,
    "SetConstraintActiveStatus": _SWITCH,
    "Simulator": "World(scene, engine='drake'), then World.run(duration)",
    "get_generalized_acceleration_output_port": _ACCELERATION,
    "num_positions": "Model.nq",
    "num_velocities": "Model.nv",
}
"""Methods and classes of Drake, besides those of quantities."""

ROBOTICSTOOLBOX = {
    "DHRobot": f"{_LOADED}, which reads no table of Denavit-Hartenberg parameters",
    "ERobot": _LOADED,
    "accel": "Backend.forward_dynamics(q, v, tau)",
    "coriolis": "Backend.coriolis_matrix(q, v)",
    "ctraj": "dynx.trajectory.line(...), a straight line of a frame",
    "fdyn": "dynx.simulate(model, controller, reference)",
    "fkine": "Backend.forward_kinematics(q, frame)",
    "fkine_all": "Backend.forward_kinematics(q)",
    "gravload": "Backend.gravity_torque(q)",
    "ikine_GN": "Backend.inverse_kinematics(pose, frame)",
    "ikine_LM": "Backend.inverse_kinematics(pose, frame)",
    "ikine_NR": "Backend.inverse_kinematics(pose, frame)",
    "inertia": "Backend.mass_matrix(q); Model.inertial(link) is the inertia of a link",
    "jacob0": "Backend.jacobian(q, frame)",
    "jacob0_dot": "Backend.jacobian_derivative(q, v, frame)",
    "jacobe": "Backend.jacobian(q, frame, reference='local')",
    "jtraj": "dynx.trajectory.quintic(q0, q1, duration)",
    "manipulability": "`numpy.prod(numpy.linalg.svd(J)[1])` with J = Backend.jacobian(q, frame)",
    "mstraj": "dynx.trajectory.spline(...) or dynx.trajectory.time_optimal_path(...)",
    "mtraj": "dynx.trajectory.quintic(q0, q1, duration), or "
    "dynx.trajectory.trapezoidal(q0, q1, velocity=..., acceleration=...)",
    "p_servo": "Backend.velocity_ik(q, dynx.ik.velocity.VelocityTask(frame, target=T, gain=gain), dt=dt), "
    "which returns the velocities of the joints",
    "qlim": "Model.lower and Model.upper",
    "rne": "Backend.inverse_dynamics(q, v, a)",
    "teach": "Model.view(), a page with a slider for each joint",
}
"""Functions and methods of roboticstoolbox."""

GYMNASIUM = {
    "VectorEnv": "the environments that gymnasium.make_vec('dynx/CartPole-v0', num_envs=1024) returns",
    "action_space": "`env.action_space` of an environment from gymnasium.make",
    "make": "gymnasium.make('dynx/CartPole-v0', engine='mujoco') after `import dynx.envs`",
    "make_vec": "gymnasium.make_vec('dynx/CartPole-v0', num_envs=1024) after `import dynx.envs`",
    "observation_space": "`env.observation_space` of an environment from gymnasium.make",
}
"""Functions, classes and attributes of Gymnasium."""

SHORT = {
    "keyframe": "Model.configurations[name]",
    "keyframes": "Model.configurations",
    "qpos0": "Model.initial_configuration",
    "com": "Backend.center_of_mass(q)",
    "cubic_spline": "dynx.trajectory.spline(times, waypoints)",
    "dof": "Model.nv, the number of velocities; Model.nq is that of coordinates",
    "fd": "Backend.forward_dynamics(q, v, tau)",
    "fk": "Backend.forward_kinematics(q, frame)",
    "id": "Backend.inverse_dynamics(q, v, a)",
    "ik": "Backend.inverse_kinematics(pose, frame)",
    "linear": "dynx.trajectory.cubic(q0, q1, duration, v0=v, v1=v) with v = (q1 - q0) / duration, at "
    "constant speed; dynx.trajectory.line(...) for a frame on a straight line in space",
    "lspb": "dynx.trajectory.trapezoidal(q0, q1, velocity=..., acceleration=...)",
    "min_jerk": "dynx.trajectory.quintic(q0, q1, duration), the motion of least jerk from rest to rest",
    "minimum_jerk": "dynx.trajectory.quintic(q0, q1, duration), the motion of least jerk from rest to rest",
    "ndof": "Model.nv, the number of velocities; Model.nq is that of coordinates",
    "plant_model": "dynx.sim.plant_model(model, payload)",
    "quintic_spline": "dynx.trajectory.spline(times, waypoints, kind='quintic')",
    "to_mjcf": "dynx.world.scene_to_mjcf(scene), of a dynx.world.Scene with the robot",
    "with_payload": "dynx.sim.plant_model(model, payload)",
}
"""Short names that textbooks and the command line have, and names that are elsewhere in dynx."""

TABLES = {
    "PyBullet": PYBULLET,
    "Pinocchio": PINOCCHIO,
    "MuJoCo": MUJOCO,
    "Drake": DRAKE,
    "roboticstoolbox": ROBOTICSTOOLBOX,
    "Gymnasium": GYMNASIUM,
}
"""What does the same in dynx, by library and name."""


KEYWORDS = {
    "T_a_b": "pose transform offset relative_pose relpose",
    "a": "qacc accelerations qdd ddq acceleration",
    "accelerometer": "noise errors acceleration accel acc",
    "backends": "engine engines backend simulators",
    "base": "fixed_base use_fixed_base floating floating_base free_flyer root_joint",
    "bodies": "objects obstacles parts shapes",
    "control_dt": "control_timestep control_period control_frequency",
    "direction": "directions ray_direction ray_to to",
    "directions": "direction ray_directions ray_to to",
    "dt": "timestep time_step step_size delta_t h",
    "duration": "time t t_end end_time final_time stop_time tf",
    "engine": "backend simulator physics physics_engine plant",
    "engines": "engine backend backends simulator simulators",
    "field_of_view": "fov fovy",
    "frame": "link body end_effector ee tool tip",
    "frames": "links bodies",
    "friction": "mu mu1 mu_static lateral_friction friction_coefficient static_friction",
    "integrator": "method solver",
    "joint_armature": "armature rotor_inertia",
    "joint_damping": "damping",
    "joint_friction": "dry_friction frictionloss coulomb",
    "joint_springs": "springs joint_stiffness spring_stiffness springref spring_reference",
    "kd": "kv derivative_gain damping d velocity_gain d_gain",
    "ki": "integral_gain i i_gain",
    "kp": "stiffness proportional_gain p position_gain p_gain",
    "length": "height range max_range max_distance",
    "material": "friction mu restitution lateral_friction color colour rgba",
    "max_force": "force max_torque effort effort_limit force_limit forcerange",
    "mass": "density m weight",
    "model": "robot urdf",
    "n": "steps num_steps n_steps count",
    "noise": "std sigma stddev standard_deviation",
    "on": "frame link body parent part site",
    "origins": "origin ray_from from",
    "part": "body link name object a",
    "payload": "load tool",
    "plant": "engine backend simulator physics physics_engine",
    "pose": "position pos xyz orientation quaternion quat rpy euler transform base_pose base_position origin",
    "point_a": "pivot anchor point",
    "position_tolerance": "tol tolerance eps ftol",
    "pushes": "forces external_force disturbances wrenches perturbations",
    "q": "qpos joint_positions joint_angles positions position q0 joints std sigma",
    "q0": "qpos qpos0 q_init init_q initial_q seed initial_guess q_start start x0 q",
    "q1": "q_end q_goal goal end qf q_target target",
    "quat_xyzw": "quaternion quat wxyz xyzw orientation",
    "radius": "r",
    "rate": "frequency hz update_rate fps",
    "reference": "trajectory path desired setpoint target",
    "restitution": "bounce bounciness e coefficient_of_restitution",
    "robots": "robot models model",
    "rolling_friction": "mu_rolling",
    "rpy": "roll pitch yaw euler angles rotation",
    "rollouts": "n count samples batch batch_size num_samples n_rollouts num_rollouts",
    "samples": "n count batch batch_size num_samples",
    "seed": "random_state rng",
    "size": "half_extents extents dimensions dims lengths width height resolution",
    "step": "dt timestep time_step step_size",
    "target": "position setpoint q_desired q_target velocity goal",
    "tau": "torque torques effort efforts ctrl u qfrc_applied",
    "torques": "torque ctrl control controls effort efforts tau action u",
    "torsional_friction": "spinning_friction mu_spin mu2",
    "v": "qvel velocities joint_velocities qd dq v0 velocity",
    "v0": "qvel qvel0 qd0 dq0 v v_init initial_velocity",
    "wrench": "force torque forces",
    "xyz": "position pos translation p t origin",
}
"""Words for arguments, by the name that dynx has for them: what other libraries and textbooks call them."""

MEANINGS = {
    "accelerometer": "dynx.world.SensorErrors; so is that of the gyroscope",
    "base": "'fixed' or 'floating'",
    "direction": "(3,)",
    "mass": "in kg",
    "material": "a dynx.world.Material, such as Material(friction=0.5)",
    "pose": "a dynx.Pose((x, y, z), (roll, pitch, yaw)) or a matrix (4, 4)",
    "quat_xyzw": "x, y, z, w",
    "rpy": "roll, pitch, yaw [rad]",
    "size": "from side to side: (x, y, z) [m] of a box, (width, height) [pixels] of a picture",
    "wrench": "force, then moment: (6,)",
}
"""Meaning of arguments whose names elsewhere stand for another quantity or another form."""

_OF_BASE_POSE = (
    "dynx.load(..., base_pose=...) sets that of a fixed base, the first seven of q that of a floating one"
)
_GRAVITY = "dynx.load(..., gravity=...) sets that of a robot, dynx.world.Scene(gravity=...) that of a scene"

ELSEWHERE = {
    "gravity g": _GRAVITY,
    "fixed_base use_fixed_base floating floating_base": "dynx.load(..., base='fixed') or 'floating' decides",
    "position pos pose base_pose base_position": _OF_BASE_POSE,
    "quaternion quat": "dynx.Pose.from_matrix(((x, y, z), (qx, qy, qz, qw))) makes a pose of one",
    "qpos qvel": "robots={name: (q, v)} has them by robot",
    "timestep time_step dt": "dynx.World(scene, dt=...) sets it",
}
"""Calls that take the arguments which a function does not take."""


def parameter_of(word: str, known: Iterable[str]) -> str | None:
    """Return the one of the `known` arguments that a library or a textbook calls `word`; None without one."""
    spelling = _spelling(word)
    for name in known:
        if spelling in map(_spelling, KEYWORDS.get(name, "").split()):
            return name
    return None


def keyword_of_dynx(word: str, known: Iterable[str]) -> str | None:
    """Return a clause with the one of the `known` arguments that others call `word`, or the call that has it;
    None for another word."""
    name = parameter_of(word, known)
    if name is not None:
        return f"; did you mean {shown(name)}{f', {MEANINGS[name]}' if name in MEANINGS else ''}?"
    for words, call in ELSEWHERE.items():
        if _spelling(word) in map(_spelling, words.split()):
            return f"; {call}"
    return None


def call_of_dynx(name: str) -> str | None:
    """Return a clause with the call of dynx for the name that an engine has; None for another name."""
    if name.endswith("Error") and hasattr(errors, name):
        return f"; dynx has dynx.errors.{name}"
    spelling = _spelling(name)
    for known, call in SHORT.items():
        if _spelling(known) == spelling:
            return f"; dynx has {call}"
    for library, table in TABLES.items():
        for known, call in table.items():
            if _spelling(known) == spelling:
                return _clause(known, library, call)
    for quantity in QUANTITIES.values():
        for library, other in quantity.other_names.items():
            if _spelling(other) == spelling:
                return _clause(other, library, method_call(quantity))
    return None


def method_call(quantity: Quantity) -> str:
    """Return the call of the method of `Backend` that computes a quantity."""
    frame = ("frame",) if "point" in quantity.options else ()
    return f"Backend.{quantity.name}({', '.join((*quantity.arguments, *frame))})"


def _clause(name: str, library: str, call: str) -> str:
    return f"; for {name} of {library} dynx has {call} (see 'Coming from {library}' in the documentation)"


def _spelling(name: str) -> str:
    """Return a name as it is in all ways of writing: ``step_simulation`` is ``stepSimulation``."""
    return name.replace("_", "").lower()


def explained(subject: str, name: str, known: Iterable[str]) -> str:
    """Return the message of the AttributeError for a name that `subject`, such as ``'World' object``, lacks.

    It names dynx's call for the name of an engine, or the nearest of the `known` names.
    """
    return f"{subject} has no attribute {shown(name)}{call_of_dynx(name) or nearest(name, known)}"
