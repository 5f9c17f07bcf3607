"""A file in URDF, MJCF or SDF as Drake loads it: ``Parser(plant).AddModels(path)`` into a `MultibodyPlant`.

The plant is continuous (``time_step=0.0``) and has no scene graph, because the equations of motion are
compared and a discrete plant returns a step of its contact solver. Inverse dynamics is called as Drake's own
`InverseDynamics` system calls it, with the forces of `CalcForceElementsContribution`, which are gravity and
joint damping. A mimic joint becomes a constraint: kinematics, mass matrix and inverse dynamics leave it out,
and forward dynamics of a continuous plant raises an exception.

**Files that Drake must not load.** For most faults Drake raises an exception, but some fail an internal check
(``DRAKE_DEMAND``). In C++ that ends the process; pydrake raises ``SystemExit``, which also ends programs that
catch ``Exception``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.engines.drake.coordinates import BallJointCoordinates, DrakeCoordinates
from dynx.engines.drake.library import (
    DRAKE_FAILURES,
    JacobianWrtVariable,
    ModelInstanceIndex,
    MultibodyForces,
    MultibodyPlant,
    Parser,
    SpatialInertia,
    UnitInertia,
    captured_log,
    drake_version,
    error_message,
)
from dynx.errors import EngineError, ModelError, UnusableEngineError, located, shown
from dynx.files.reading import read_file
from dynx.loaded.robot import (
    EngineBase,
    EngineCoordinates,
    LoadedInertial,
    LoadedJoint,
    LoadedModel,
    LoadedRobot,
    called_joints,
    checked_format,
    lacking_joints,
    require_file,
)
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.document_format import Format
from dynx.model.mechanism import float64, pose_arrays
from dynx.model.package_search import MODEL_MANIFEST
from dynx.model.xml.source import SourceElement, XmlSource
from dynx.spatial.inertia import inertia_about_origin
from dynx.spatial.scalar import Floats

CALLS: Mapping[str, str] = {
    "drake.no_damping": (
        "for i in plant.GetJointIndices():  # before plant.Finalize()\n"
        "    joint = plant.get_mutable_joint(i)\n"
        "    joint.set_default_damping_vector(0 * joint.default_damping_vector())"
    ),
    "drake.free_mimics": (
        "for i in plant.GetConstraintIds(): plant.RemoveConstraint(i)  # before plant.Finalize()"
    ),
    "drake.no_rotors": (
        "for i in plant.GetJointActuatorIndices():  # before plant.Finalize()\n"
        "    plant.get_mutable_joint_actuator(i).set_default_rotor_inertia(0)"
    ),
    "drake.add_models": (
        "parser = Parser(plant)  # for each model://NAME of the file, before parser.AddModels(path)\n"
        "parser.package_map().Add(NAME, FOLDER)"
    ),
    "drake.set_inertias": (
        "# for each link in Drake's warnings; I is about the link's origin, in its axes;\n"
        "# where the file has no mass, m = 2**-200, because Drake holds an inertia per unit of mass\n"
        "G = UnitInertia(*(I[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]] / m))\n"
        "M = SpatialInertia(m, center_of_mass, G, skip_validity_check=True)\n"
        "plant.GetBodyByName(link).SetSpatialInertiaInBodyFrame(context, M)"
    ),
}

NEGLIGIBLE_MASS = 2.0**-200
"""Mass [kg] of a link for which the file states an inertia and no mass: a power of two, so that dividing
by it is exact, and so small that its weight is below rounding."""


def model_folders(path: Path) -> dict[str, Path]:
    """Return the folders of the models that a document in SDF includes as ``model://NAME``, and of those that
    they include, by name. A folder has a manifest, or the file that the URI names in it.

    Each is looked for around its document, also in folders ``models`` there, in no more folders than links
    lead to (`dynx.doctor.examination`).
    """
    found: dict[str, Path] = {}
    waiting = [path]
    while waiting:
        document = waiting.pop()
        for encoded in _MODEL_URI.findall(read_file(str(document))):
            name, inside = (part.decode(errors="replace") for part in encoded)
            around = [] if name in found else document.parents[:_FOLDERS_ABOVE]
            for folder in (above / below / name for above in around for below in ("", "models")):
                if (folder / MODEL_MANIFEST).is_file() or (inside and (folder / inside).is_file()):
                    found[name] = folder
                    waiting += sorted(folder.glob("*.sdf"))
                    break
    return found


_FOLDERS_ABOVE = 5
"""Number of folders, that of the document included, in which a model is looked for."""

_MODEL_URI = re.compile(rb"model://([^/<\s.][^/<\s]*)/?([^<\s]*)")


def set_before_finalize(plant: Any, joints: Mapping[str, Any], path: Path, calls: Collection[str]) -> None:
    """Apply those of `calls` that must precede `Finalize`; `joints` are those of the file, by name."""
    for name in called_joints(calls, "drake.no_damping", joints):
        joint = plant.get_mutable_joint(joints[name].index())
        joint.set_default_damping_vector(0.0 * joint.default_damping_vector())
    constraints = plant.GetConstraintIds()
    if "drake.free_mimics" in calls or path.suffix != ".urdf":
        freed = constraints if "drake.free_mimics" in calls else []
    else:
        # Drake numbers them in document order and does not name their joints.
        followers = _followers(path) if constraints else []
        known = dict(zip(followers, constraints, strict=False)) if len(followers) == len(constraints) else {}
        freed = [known[name] for name in called_joints(calls, "drake.free_mimics", known)]
    for constraint in freed:
        plant.RemoveConstraint(constraint)
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_mutable_joint_actuator(index)
        if any(called_joints(calls, "drake.no_rotors", [actuator.joint().name()])):
            actuator.set_default_rotor_inertia(0.0)


def _followers(path: Path) -> list[str]:
    """Name the joints with a ``<mimic>``, in document order."""
    joints = XmlSource(path.read_bytes(), str(path)).root.all("joint")
    return [joint.attributes.get("name", "") for joint in joints if joint.first("mimic") is not None]


def set_in_context(context: Any, bodies: Mapping[str, Any], model: Model, calls: Collection[str]) -> None:
    """Apply those of `calls` that act on a context; the inertias are those of `model`."""
    if "drake.set_inertias" not in calls:
        return
    for link in model.links:
        if link.inertial is None or link.name not in bodies or link.name == "world":
            continue
        R, p = pose_arrays(link.inertial.origin, float64)
        stated = inertia_about_origin(float64(link.inertial.mass), p, R, float64(link.inertial.tensor))
        mass = float(stated.mass) or NEGLIGIBLE_MASS
        G = np.asarray(stated.rotational_inertia / mass)
        unit = UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2])
        inertia = SpatialInertia(mass, p, unit, skip_validity_check=True)
        bodies[link.name].SetSpatialInertiaInBodyFrame(context, inertia)


def describe_link(body: Any, context: Any) -> LoadedInertial:
    """Return the inertia of a body about its centre of mass. Drake stores it about the link's origin.

    Drake's world, which is the body of a link named ``world``, has no mass.
    """
    if body.index() == 0:
        return LoadedInertial(0.0, np.zeros(3), np.zeros((3, 3)))
    held = body.CalcSpatialInertiaInBodyFrame(context)
    mass, center = float(held.get_mass()), np.array(held.get_com())
    unit: Floats = np.array(held.get_unit_inertia().CopyToFullMatrix3())
    central = mass * (unit - (center @ center) * np.eye(3) + np.outer(center, center))
    return LoadedInertial(mass, center, central)


def describe_joint(joint: Any, actuator: Any | None, form: Format = "urdf") -> LoadedJoint:
    """Return the description of a joint that moves; effort and armature are those of its actuator, if any.

    A joint of SDF has a frame of its own, so that its axis is given in the frame of the child, and its place
    shows in the poses of links alone.
    """
    placement: Floats | None = np.array(joint.frame_on_parent().GetFixedPoseInBodyFrame().GetAsMatrix4())
    R_child: Floats = np.eye(3)
    if form == "sdf":
        placement = None
        R_child = joint.frame_on_child().GetFixedPoseInBodyFrame().rotation().matrix()
    kind = str(joint.type_name())
    if joint.num_velocities() != 1:
        damping = float(joint.default_damping_vector()[0]) if kind == BALL else None
        return LoadedJoint(kind, None if kind == BALL else placement, damping=damping)
    prismatic = kind == "prismatic"
    lower, upper = float(joint.position_lower_limits()[0]), float(joint.position_upper_limits()[0])
    unbounded = not prismatic and bool(np.isinf([lower, upper]).all())
    return LoadedJoint(
        type="continuous" if unbounded else kind,
        placement=placement,
        axis=R_child @ np.array(joint.translation_axis() if prismatic else joint.revolute_axis()),
        limits=(lower, upper),
        velocity=float(joint.velocity_upper_limits()[0]),
        effort=None if actuator is None else float(actuator.effort_limit()),
        damping=float(joint.default_damping_vector()[0]),
        friction=0.0,
        armature=0.0 if actuator is None else float(actuator.default_reflected_inertia()),
    )


def remarks(log: Iterable[str], path: str, plant: Any) -> tuple[str, ...]:
    """Return Drake's log messages, each once and on one line, and the number of constraints that it made."""
    lines = [" ".join(message.replace(f"{path}:", "line ").split()) for message in log]
    if plant.num_constraints():
        lines.append(f"{plant.num_constraints()} couplings of joints are constraints")
    return tuple(dict.fromkeys(lines))


MAX_LINKS = 2000
"""Largest number of links: the time to load grows with its square, and loading cannot be interrupted."""

_MOVING = ("revolute", "continuous", "prismatic")

BALL = "ball_rpy"
"""Drake's name of the type of a ball joint."""


def require_harmless(path: Path, model: Model) -> None:
    """Raise EngineError for a file on which Drake would end the process or misplace the robot."""
    require_file(path)
    if len(model.links) > MAX_LINKS:
        count = len(model.links)
        raise UnusableEngineError(f"{model.name} has {count} links; drake can load at most {MAX_LINKS}")
    _require_own_world(model)
    try:
        source = XmlSource(read_file(str(path)), str(path))
    except ModelError as error:
        raise EngineError(f"drake cannot load a file that is not XML: {error}") from error
    for message, line in _fatal_faults(source):
        raise UnusableEngineError(located(f"drake would end the process: {message}", str(path), line))


def _require_own_world(model: Model) -> None:
    """Raise EngineError if Drake would mistake a link named ``world`` for its world."""
    if "world" not in {link.name for link in model.links}:
        return
    if model.root != "world":
        raise UnusableEngineError(
            f"drake mistakes the link 'world' of {model.name} for the world itself, so the robot is attached "
            "there and not at its root"
        )
    if model.floating:
        raise UnusableEngineError(
            f"drake mistakes the link 'world' of {model.name} for the world itself, so its base cannot float"
        )


def _fatal_faults(source: XmlSource) -> Iterator[tuple[str, int]]:
    root = source.root
    if root.attributes.get("name") == "":
        yield "the robot's name is empty", root.line
    for transmission in root.all("transmission"):
        kind = transmission.first("type")
        # Drake does not check whether the element has text.
        if kind is not None and "type" not in transmission.attributes and not _begins_with_text(source, kind):
            yield "the <type> of a <transmission> has no text", kind.line
    for joint in root.all("joint"):
        if joint.attributes.get("type") not in _MOVING:
            continue
        name = shown(joint.attributes.get("name", ""))
        for limit in joint.all("limit")[:1]:
            lower, upper = _number(limit, "lower", -math.inf), _number(limit, "upper", math.inf)
            if lower > upper:
                yield f"joint {name} has lower limit {lower:g} above its upper limit {upper:g}", limit.line
            for bound in ("velocity", "drake:acceleration"):
                value = _number(limit, bound, math.inf)
                if value < 0.0:
                    yield f"joint {name} has a negative limit, {bound} {value:g}", limit.line


def _begins_with_text(source: XmlSource, element: SourceElement) -> bool:
    """Check whether an element begins with text, other than blanks and comments."""
    if element.empty:
        return False
    end = (
        element.children[0].span.start if element.children else source.data.rindex(b"</", 0, element.span.end)
    )
    inside = source.data[element.start_tag.end : end]
    return bool(re.sub(rb"<!--.*?-->", b"", inside, flags=re.DOTALL).strip())


def _number(element: SourceElement, attribute: str, default: float) -> float:
    """Return the attribute as a number; the default where it is absent or not a number."""
    try:
        value = float(element.attributes.get(attribute, default))
    except ValueError:
        return default
    return default if math.isnan(value) else value


_V = JacobianWrtVariable.kV

_WORLD = "world"
"""Name of the link that Drake takes for its world."""

_WELD = "plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root_link))"

_OWN_INSTANCES = 2
"""Number of model instances of an empty plant: the world and the default one."""

_ORIGIN: Floats = np.zeros(3)


class LoadedDrake(LoadedRobot):
    """A robot as Drake loads it; see `LoadedRobot` and the module docstring."""

    name: ClassVar[str] = "drake"
    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf", "sdf")
    CALLS: ClassVar[Mapping[str, str]] = CALLS
    takes_ball_joints: ClassVar[bool] = True

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        self._form = checked_format(type(self), path)
        if self._form == "urdf":
            require_harmless(path, model)
        self._model = model
        # The lines shown to users are those that are executed.
        create, read, *weld, finalize = self.load_call(model.floating, model.root, self._form).splitlines()
        names = {
            "MultibodyPlant": MultibodyPlant,
            "Parser": self._parser(path, calls),
            "path": str(path),
            "root_link": model.root,
        }
        exec(create, names)
        self._plant = plant = names["plant"]
        with self._convert_errors("load"), captured_log() as log:
            exec(read, names)
            instances = [ModelInstanceIndex(k) for k in range(_OWN_INSTANCES, plant.num_model_instances())]
            self._default_gravity: Floats = np.array(plant.gravity_field().gravity_vector())
            plant.mutable_gravity_field().set_gravity_vector(np.array(model.gravity))
            self._bodies = self._find_bodies(instances)
            if model.root not in self._bodies:
                raise UnusableEngineError(f"drake lacks the root link {shown(model.root)} of {model.name}")
            exec("\n".join(weld), names)
            self._joints = self._find_joints(instances)
            set_before_finalize(plant, self._joints, path, calls)
            exec(finalize, names)
            self._context = plant.CreateDefaultContext()
            set_in_context(self._context, self._bodies, model, calls)
            self._forces = MultibodyForces(plant)
        self._remarks = remarks(log, str(path), plant)
        self._places = self._find_coordinates()
        base = self._places.base
        first = None if base is None else (base.q[-1], base.v[3])
        sizes = plant.num_positions(), plant.num_velocities()
        joints_q, joints_v, balls = self._places.joints_q, self._places.joints_v, self._find_balls()
        self._coordinates = (
            BallJointCoordinates(joints_q, joints_v, *sizes, first, balls)
            if balls
            else DrakeCoordinates(joints_q, joints_v, *sizes, first)
        )
        self._torque = plant.get_applied_generalized_force_input_port()
        self._acceleration = plant.get_generalized_acceleration_output_port()

    @staticmethod
    def _parser(path: Path, calls: Collection[str]) -> Callable[[Any], Any]:
        """Return what makes a parser of a plant, which knows the folders of models if `calls` say so."""
        folders = model_folders(path) if "drake.add_models" in calls else {}

        def knowing(plant: Any) -> Any:
            parser = Parser(plant)
            for name, folder in folders.items():
                parser.package_map().Add(name, str(folder))
            return parser

        return knowing

    @classmethod
    def engine_version(cls) -> str:
        """Return the version of Drake's distribution, such as ``1.51.1``."""
        return drake_version()

    @classmethod
    @checks_types
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the call: four lines for a fixed base in URDF. The line with ``WeldFrames`` is omitted for a
        floating one, for a root named ``world``, which is Drake's world itself, and for other formats, which
        state what is fixed to the world."""
        weld = "" if floating or root == _WORLD or form != "urdf" else f"{_WELD}\n"
        return f"plant = MultibodyPlant(time_step=0.0)\nParser(plant).AddModels(path)\n{weld}plant.Finalize()"

    # -- quantities ------------------------------------------------------------------------------

    def link_poses(self, q: Floats) -> Floats:
        """Return the poses that ``EvalBodyPoseInWorld`` gives."""
        T = np.full((len(self._model.links), 4, 4), np.nan)
        with self._convert_errors("EvalBodyPoseInWorld"):
            self._place(q)
            for k, link in enumerate(self._model.links):
                if link.name in self._bodies:
                    body = self._bodies[link.name]
                    T[k] = self._plant.EvalBodyPoseInWorld(self._context, body).GetAsMatrix4()
        return T

    @checks_types
    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the result of ``CalcJacobianSpatialVelocity`` with respect to v, linear rows first."""
        if link not in self._bodies:
            return np.full((6, self._model.nv), np.nan)
        frame, world = self._bodies[link].body_frame(), self._plant.world_frame()
        with self._convert_errors("CalcJacobianSpatialVelocity"):
            R = self._place(q)
            J = self._plant.CalcJacobianSpatialVelocity(self._context, _V, frame, _ORIGIN, world, world)
        return self._coordinates.forces_back(R, np.concatenate([J[3:], J[:3]]))

    def mass_matrix(self, q: Floats) -> Floats:
        """Return the result of ``CalcMassMatrix``, which includes the reflected inertia of rotors."""
        with self._convert_errors("CalcMassMatrix"):
            R = self._place(q)
            return self._coordinates.matrix_back(R, np.array(self._plant.CalcMassMatrix(self._context)))

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque of ``CalcInverseDynamics`` with forces by ``CalcForceElementsContribution``."""
        plant, coordinates = self._plant, self._coordinates
        with self._convert_errors("CalcInverseDynamics"):
            R = self._place(q)
            plant.SetVelocities(self._context, coordinates.velocities(R, v))
            plant.CalcForceElementsContribution(self._context, self._forces)
            vdot = coordinates.accelerations(R, v, a)
            tau = np.array(plant.CalcInverseDynamics(self._context, vdot, self._forces))
        return coordinates.forces_back(R, tau)

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the output port ``generalized_acceleration``.

        Where a joint that the model lacks is held, the acceleration is solved from ``CalcMassMatrix`` and
        ``CalcInverseDynamics``.
        """
        if self._model.nv < self._plant.num_velocities():
            return self._solved_acceleration(q, v, tau)
        with self._convert_errors("compute forward dynamics of"):
            R = self._place(q)
            self._plant.SetVelocities(self._context, self._coordinates.velocities(R, v))
            self._torque.FixValue(self._context, self._coordinates.forces(R, tau))
            vdot = np.array(self._acceleration.Eval(self._context))
        return self._coordinates.accelerations_back(R, v, vdot)

    def close(self) -> None:
        """Do nothing: the interpreter frees all resources."""

    # -- what was loaded ----------------------------------------------------------------------

    def describe(self) -> LoadedModel:
        """Describe the model from the engine's bodies, joints and actuators; Drake merges no links.

        Joint friction is 0, because Drake has none and warns about files with joint friction.
        """
        rotors = {}
        for index in self._plant.GetJointActuatorIndices():
            actuator = self._plant.get_joint_actuator(index)
            rotors[self._scoped(actuator.joint())] = actuator
        names = [link.name for link in self._model.links]
        return LoadedModel(
            engine=self.name,
            links={
                name: describe_link(self._bodies[name], self._context)
                for name in names
                if name in self._bodies
            },
            joints={
                name: describe_joint(joint, rotors.get(name), self._form)
                for name, joint in self._joints.items()
                if joint.num_velocities()
            },
            base_frame=np.eye(4)
            if self._model.floating and self._form != "urdf"
            else self.link_poses(self._model.neutral())[0],
            gravity=self._default_gravity,
            missing_links=tuple(name for name in names if name not in self._bodies),
            remarks=self._remarks,
        )

    # -- coordinates --------------------------------------------------------------------------

    def _find_bodies(self, instances: list[Any]) -> dict[str, Any]:
        plant = self._plant
        found = {
            self._scoped(plant.get_body(index)): plant.get_body(index)
            for instance in instances
            for index in plant.GetBodyIndices(instance)
        }
        if self._model.root == "world":
            found["world"] = plant.world_body()
        return found

    def _find_joints(self, instances: list[Any]) -> dict[str, Any]:
        """Return the file's joints by name, without the one to the world that is a weld or floats."""
        plant = self._plant
        known = {joint.name for joint in self._model.joints}
        joints = [
            plant.get_joint(index) for instance in instances for index in plant.GetJointIndices(instance)
        ]
        named: dict[str, Any] = {}
        for joint in joints:
            # Drake puts a joint into the nested model of its child, wherever the file states it.
            scopes = self._scoped(joint).split("::")
            around = ["::".join([*scopes[:depth], scopes[-1]]) for depth in range(len(scopes) - 1, -1, -1)]
            name = next((each for each in around if each in known and each not in named), None)
            if name is not None:
                named[name] = joint
        return named

    def _scoped(self, part: Any) -> str:
        """Return the name of a body or joint as dynx has it: below that of the nested model of SDF."""
        if self._form != "sdf":
            return str(part.name())
        _, _, nested = str(self._plant.GetModelInstanceName(part.model_instance())).partition("::")
        return f"{nested}::{part.name()}" if nested else str(part.name())

    def coordinates(self) -> EngineCoordinates:
        """Return the places of the joints in the q and v of the plant.

        Raises UnsupportedFeatureError for a ball joint, of which Drake has three angles instead of a
        quaternion.
        """
        refuse_ball_joints(self._model, "the order of the coordinates of 'drake'", "that of 'mujoco' does")
        return self._places

    def _find_coordinates(self) -> EngineCoordinates:
        """Return the places of the joints of the model in the q and v of the plant."""
        plant, model = self._plant, self._model
        wanted = [self._joints.get(name) for name in model.joint_names]
        wrong = {
            name: "not there" if joint is None else str(joint.type_name())
            for name, joint in zip(model.joint_names, wanted, strict=True)
            if joint is None or joint.num_velocities() != (3 if model.joint(name).type == "ball" else 1)
        }
        free = {
            str(joint.child_body().name()): joint
            for joint in map(plant.get_joint, plant.GetJointIndices())
            if joint.type_name() == "quaternion_floating"
        }
        floating = free.pop(model.root, None) if model.floating else None
        if model.floating and floating is None and len(free) == 1 and not wrong:
            other, root = shown(next(iter(free))), shown(model.root)
            raise UnusableEngineError(f"drake lets {other} float instead of the root {root} of {model.name}")
        # A joint of six degrees of freedom cannot be held at zero: zero is no attitude.
        wrong |= dict.fromkeys(free, "free")
        if wrong:
            raise lacking_joints(self.name, model, wrong)
        if model.floating and floating is None:
            raise UnusableEngineError(f"drake does not let the base of {model.name} float")
        base, neutral = None, np.zeros(plant.num_positions())
        if floating is not None:
            at_q, at_v = int(floating.position_start()), int(floating.velocity_start())
            neutral[at_q] = 1.0
            q = tuple(at_q + k for k in (4, 5, 6, 1, 2, 3, 0))
            base = EngineBase(q, tuple(at_v + k for k in (3, 4, 5, 0, 1, 2)), True, True)
        joints = [joint for joint in wanted if joint is not None]
        return EngineCoordinates(
            neutral,
            int(plant.num_velocities()),
            tuple(int(joint.position_start()) + k for joint in joints for k in range(joint.num_positions())),
            tuple(int(joint.velocity_start()) + k for joint in joints for k in range(joint.num_velocities())),
            (False,) * len(joints),
            base,
        )

    def _find_balls(self) -> list[tuple[int, int, Floats]]:
        """Return the index of each ball joint in q and v of dynx, and the rotation of Drake's frame on its
        child."""
        model = self._model
        return [
            (
                model.position_index(joint.name),
                model.coordinate_index(joint.name),
                self._joints[joint.name].frame_on_child().GetFixedPoseInBodyFrame().rotation().matrix(),
            )
            for joint in model.ball_joints
        ]

    def _place(self, q: Floats) -> Floats:
        """Set the configuration of the context, and return the attitude of the base."""
        self._plant.SetPositions(self._context, self._coordinates.positions(q))
        return self._coordinates.attitude(q)

    @contextmanager
    def _convert_errors(self, call: str) -> Iterator[None]:
        """Raise the engine's exceptions as `EngineError` with its messages."""
        try:
            yield
        except EngineError:
            raise
        except DRAKE_FAILURES as error:
            raise EngineError(f"drake failed to {call} {self._model.name}: {error_message(error)}") from error
