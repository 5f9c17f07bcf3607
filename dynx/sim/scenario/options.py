"""Options of a simulation, each declared once: a field with its default, meaning, unit and kind.

From the fields of `SimulationOptions` follow the signatures of `dynx.simulate` and `dynx.simulate_batch`
(`takes`), the fields of `Scenario` and their checks, a scenario's document and its JSON
Schema, the options of ``dynx sim`` (`dynx.cli.shell.kinds`), and the table of the documentation. A new
option is a field here, and the code in which it acts.

The command line shows its help by this module, so it imports NumPy and the rest of dynx only for checks.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from functools import wraps
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar, cast

from dynx.argument_types import is_listed
from dynx.errors import ArgumentError, UnknownNameError, shown
from dynx.option_names import as_object, right_name
from dynx.registry import DEFAULT_ENGINE

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from dynx.backends.joint_friction import Coefficients
    from dynx.model import Model
    from dynx.rbd.parameters import MassScale, Payload
    from dynx.sim.noise import Noise
    from dynx.sim.plants.scene_plant import ScenePlant
    from dynx.steppers.forces import ExternalForce
    from dynx.world.sensors.sensor import Sensor

T = TypeVar("T")
P = ParamSpec("P")
A = TypeVar("A")
R = TypeVar("R")

NumberOrArray = bool | float | list[Any] | dict[str, Any] | None
"""JSON type of one number, an array, or true for the values of the robot description."""


# -- kinds ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """Kind of values that an option takes."""

    values: str
    """Valid values of an argument, in words."""
    json_type: Any
    """Type of a value in a scenario's document."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return the value of the option `name` as a scenario of `model` keeps it.

        Raises ArgumentError or one of its kinds for an invalid value.
        """
        return value


class Number(Kind):
    """One real number."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return a float, or None; bounds are checked where the number is used."""
        from dynx.model.numbers import is_real

        if value is None:
            return None
        if not is_real(value):
            raise ArgumentError(f"{name} is {shown(value)}; wanted {self.values}")
        return float(value)


class SlipSpeed(Number):
    """The speed up to which a friction law is smoothed."""

    def checked(self, name: str, value: Any, model: Model) -> float:
        """Return a float that is 0 or at least `dynx.backends.joint_friction.MIN_SLIP`."""
        from dynx.backends.joint_friction import checked_slip

        return checked_slip(name, value)


class Count(Kind):
    """A whole number."""


class Flag(Kind):
    """A truth value."""

    def checked(self, name: str, value: Any, model: Model) -> bool:
        """Return a bool."""
        import numpy as np

        if not isinstance(value, bool | np.bool_):
            raise ArgumentError(f"{name} is {shown(value)}; wanted True or False")
        return bool(value)


@dataclass(frozen=True)
class Choice(Kind):
    """One of several names."""

    source: str = ""
    """Names, as ``module:attribute``."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return a name or None; the spelling of the command line, semi-implicit, is that of Python."""
        if not isinstance(value, str | None):
            raise ArgumentError(f"{name} is {shown(value)}; wanted the name of one, or None")
        if value is None or "-" not in value:
            return value
        module, _, attribute = self.source.partition(":")
        name = value.replace("-", "_")
        return name if name in getattr(import_module(module), attribute) else value


class PlantKind(Kind):
    """A plant: the name of an engine, or a robot in a scene."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return a text, or a ScenePlant whose robot is the model."""
        from dynx.sim.plants.scene_plant import ScenePlant

        if isinstance(value, ScenePlant):
            value.require_model(model)
        elif not isinstance(value, str):
            raise ArgumentError(
                f"{name} is of type {type(value).__name__}; wanted the name of a plant or a ScenePlant"
            )
        return value


class Coordinates(Kind):
    """One number for each coordinate: a configuration (nq,) or a velocity (nv,)."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return a read-only array for a list of numbers."""
        return as_array(name, value)


@dataclass(frozen=True)
class JointNumbers(Kind):
    """Numbers of joints: True for those of the description, False, one number, one for each joint, or numbers
    by joint."""

    others: float = 0.0
    """Number of the joints that are not named in numbers by joint."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return a bool, a number or a read-only array (joints,)."""
        from dynx.backends.joint_friction import coefficients_by_joint

        if value is None:
            raise ArgumentError(f"{name} is None; wanted True (those of the model), False or numbers")
        return as_array(name, coefficients_by_joint(model, name, value, self.others))


@dataclass(frozen=True)
class Parts(Kind):
    """One object of a class or several."""

    source: str = ""
    """The class, as ``module:Class``."""
    several: bool = True
    optional: bool = False
    """True if None stands for no object."""

    @property
    def part_class(self) -> type[Any]:
        """The class of the objects."""
        module, _, name = self.source.partition(":")
        found: type[Any] = getattr(import_module(module), name)
        return found

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return the objects as a tuple; one object or None where the option takes no more.

        Objects of a file that cannot be rebuilt here are kept (`Unknown`).
        """
        from dynx.sim.scenario.documents import Unknown

        known = (self.part_class, Unknown)
        if not self.several:
            if value is None or isinstance(value, known):
                return value
            raise ArgumentError(f"{name} is {shown(value)}; wanted {self.values}")
        if value is None and not self.optional:
            raise ArgumentError(f"{name} is None; wanted {self.values}")
        given = () if value is None else value
        parts = tuple(given) if is_listed(given) else (given,)
        if isinstance(given, Mapping) or not all(isinstance(each, known) for each in parts):
            part = self.part_class
            clause = as_object(given, part.__name__, inspect.signature(part).parameters)
            raise ArgumentError(f"{name} is {shown(given)}; wanted {self.values}{clause}")
        return parts


class SensorParts(Parts):
    """Sensors, whose classes are imported only for simulations that have some."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return the sensors as a tuple."""
        return value if isinstance(value, tuple) and not value else super().checked(name, value, model)


class Factors(Kind):
    """One factor, or factors by the name of a link."""

    def checked(self, name: str, value: Any, model: Model) -> Any:
        """Return factors by name in alphabetical order."""
        if not isinstance(value, Mapping):
            return value
        return dict(sorted(value.items(), key=lambda entry: str(entry[0])))


def as_array(name: str, value: Any) -> Any:
    """Convert lists of numbers to a read-only array; return anything else unchanged. Raises DTypeError for a
    masked array."""
    import numpy as np

    from dynx.errors import ShapeError
    from dynx.model.numbers import array_of, refuse_mask

    refuse_mask(name, value)
    if not isinstance(value, list | tuple | np.ndarray):
        return value
    try:
        array = np.array(array_of(name, value))
    except ShapeError:  # of rows of several lengths, which the caller may take
        return value
    if array.dtype.kind in "iuf":
        array = array.astype(np.float64)
    array.setflags(write=False)
    return array


NUMBER = Number("a number", float)
SLIP = SlipSpeed("a number", float)
SECONDS = Number("a number of seconds", float)
COUNT = Count("a whole number", int)
FLAG = Flag("True or False", bool)
PLANT = PlantKind("the name of a backend or plant, or a ScenePlant", str | dict[str, Any])
CONFIGURATION = Coordinates("(nq,)", NumberOrArray)
VELOCITY = Coordinates("(nv,)", NumberOrArray)
_JOINT_VALUES = (
    "True (values of the description); False ({without}); one number for all joints; "
    "one number for each joint; or a dict of numbers by joint name"
)
COEFFICIENTS = JointNumbers(_JOINT_VALUES.format(without="0"), NumberOrArray)
LIMITS = JointNumbers(_JOINT_VALUES.format(without="unlimited"), NumberOrArray, others=math.inf)
FACTORS = Factors("a factor, or factors by link", float | dict[str, Any])
NOISE = Parts("a dynx.Noise, as in Noise(v=1e-3)", dict[str, Any], "dynx.sim.noise:Noise", several=False)
PAYLOADS = Parts(
    "a Payload, or a list of them", list[dict[str, Any]], "dynx.rbd.parameters:Payload", optional=True
)
PUSHES = Parts(
    "an ExternalForce, or a list of them", list[dict[str, Any]], "dynx.steppers.forces:ExternalForce"
)
SENSORS = SensorParts(
    "a sensor, such as dynx.world.Imu, or a list of them",
    list[dict[str, Any]],
    "dynx.world.sensors.sensor:Sensor",
)
INTEGRATOR = Choice("a name", str, "dynx.sim.plants.registry:INTEGRATORS")
METHOD = Choice("a name", str, "dynx.steppers.integrators:METHODS")


# -- declarations ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Option:
    """Declaration of an option; `option` makes the field of a dataclass from it."""

    name: str
    help: str
    """Meaning, as a noun phrase; other options stand in backticks."""
    default: Any
    default_words: str
    """Meaning of the default, where the value does not say it."""
    unit: str
    kind: Kind
    rows: bool
    """Whether it may have one row for each rollout of a batch."""
    group: str
    """Heading under which ``dynx sim --help`` lists it."""
    flag: str
    """Name on the command line, if that is not its own; ``-`` if the option follows from others there."""
    needs: tuple[str, str]
    """Option, and its value or "", without which this one has no effect."""

    @property
    def described(self) -> str:
        """Meaning with the unit after its first noun phrase."""
        if not self.unit:
            return self.help
        ends = [place for mark in (",", ";", ":") if (place := self.help.find(mark)) >= 0]
        end = min(ends, default=len(self.help))
        return f"{self.help[:end]} [{self.unit}]{self.help[end:]}"

    @property
    def default_text(self) -> str:
        """The default in words; empty for a flag and for parts, which are absent by default."""
        if self.default_words or isinstance(self.default, bool | tuple | None):
            return self.default_words
        return self.default if isinstance(self.default, str) else f"{self.default:g}"

    @property
    def line(self) -> str:
        """Meaning and default for a docstring."""
        return f"{self.described} (default: {self.default_text or repr(self.default)})"

    @property
    def json_type(self) -> Any:
        """Type of its value in a scenario's document."""
        return self.kind.json_type | None if self.default is None else self.kind.json_type


def option(
    default: T,
    help: str,
    *,
    unit: str = "",
    kind: Kind = NUMBER,
    rows: bool = False,
    group: str,
    default_words: str = "",
    flag: str = "",
    needs: tuple[str, str] = ("", ""),
) -> T:
    """Return the field of an option for a dataclass; the entries are those of `Option`."""
    declared = Option("", help, default, default_words, unit, kind, rows, group, flag, needs)
    return field(default=default, metadata={"option": declared})


def options_of(cls: type[Any]) -> Iterator[Option]:
    """Yield the options of a dataclass, in the order of its fields."""
    for each in fields(cls):
        if "option" in each.metadata:
            yield replace(each.metadata["option"], name=each.name)


CLOCK = "Plant and time steps"
REFERENCE = "Reference motion"
CONTROL = "Controller"
JOINTS = "Joint dynamics, limits and disturbances"
ERRORS = "Model error and sensor noise"

_ADAPTIVE = ("integrator", "adaptive")


@dataclass(frozen=True, eq=False, repr=False)
class SimulationOptions:
    """Options of a simulation besides the robot, its controller and the reference.

    `dynx.simulate` documents how they act together.
    """

    _: KW_ONLY
    plant: str | ScenePlant = option(
        DEFAULT_ENGINE,
        "Backend or plant that moves the robot; pybullet is PyBullet's stepper",
        kind=PLANT,
        group=CLOCK,
    )
    integrator: str | None = option(
        None,
        "Integrator: `semi_implicit`, `rk4`, `adaptive`, or `engine` (PyBullet's, MuJoCo's or Drake's own)",
        kind=INTEGRATOR,
        group=CLOCK,
        default_words="`engine` for the plant pybullet, else `semi_implicit`",
    )
    substeps: int = option(1, "Number of steps of the plant in each time step", kind=COUNT, group=CLOCK)
    method: str = option(
        "DOP853",
        "SciPy method of the integrator `adaptive`",
        kind=METHOD,
        group=CLOCK,
        needs=_ADAPTIVE,
    )
    rtol: float = option(
        1e-10, "Relative tolerance of the integrator `adaptive`", group=CLOCK, needs=_ADAPTIVE
    )
    atol: float = option(
        1e-12, "Absolute tolerance of the integrator `adaptive`", group=CLOCK, needs=_ADAPTIVE
    )
    dt: float = option(1e-3, "Time step of the record", unit="s", kind=SECONDS, group=CLOCK)
    duration: float | None = option(
        None,
        "Time to simulate, rounded up to a multiple of `dt`; a `Simulation` does not need it",
        unit="s",
        kind=SECONDS,
        group=REFERENCE,
        flag="-",
        default_words="that of the reference",
    )
    control_dt: float | None = option(
        None,
        "Period of the controller, a multiple of `dt`",
        unit="s",
        kind=SECONDS,
        group=CONTROL,
        default_words="`dt`",
    )
    delay: float = option(
        0.0, "Delay of the measurements, a multiple of `dt`", unit="s", kind=SECONDS, group=CONTROL
    )
    q0: ArrayLike | None = option(
        None,
        "Initial configuration of the robot",
        unit="rad or m",
        kind=CONFIGURATION,
        rows=True,
        group=CLOCK,
        default_words="where the motion begins",
    )
    v0: ArrayLike | None = option(
        None,
        "Initial velocity of the robot",
        unit="rad/s or m/s",
        kind=VELOCITY,
        rows=True,
        group=CLOCK,
        default_words="that of the motion",
    )
    noise: Noise | None = option(
        None,
        "Noise of the measurements; its seed also gives the random numbers of the controller",
        kind=NOISE,
        group=ERRORS,
        default_words="none",
    )
    joint_damping: Coefficients = option(
        True,
        "Viscous damping of the joints",
        unit="N m s/rad or N s/m",
        kind=COEFFICIENTS,
        rows=True,
        group=JOINTS,
        default_words="the description's",
    )
    joint_friction: Coefficients = option(
        True,
        "Coulomb friction of the joints, which holds them at rest up to its magnitude",
        unit="N m or N",
        kind=COEFFICIENTS,
        rows=True,
        group=JOINTS,
        default_words="the description's",
    )
    friction_slip: float = option(
        0.0,
        "Slip velocity s of smooth Coulomb friction f tanh(v / s); 0 for friction that holds joints at rest",
        unit="rad/s or m/s",
        kind=SLIP,
        group=JOINTS,
        needs=("joint_friction", ""),
    )
    joint_armature: Coefficients = option(
        True,
        "Rotor inertia of the joints",
        unit="kg m^2 or kg",
        kind=COEFFICIENTS,
        rows=True,
        group=JOINTS,
        default_words="the description's",
    )
    joint_springs: bool = option(
        True, "Springs of the joints, as the robot description has them", kind=FLAG, group=JOINTS
    )
    effort_limits: Coefficients = option(
        False,
        "Limits at which torques are saturated",
        unit="N m or N",
        kind=LIMITS,
        group=JOINTS,
        default_words="unlimited",
    )
    joint_limits: bool = option(
        True,
        "Inelastic stops at the position limits of the joints; in a scene the stops of its engine",
        kind=FLAG,
        group=JOINTS,
    )
    payload: Payload | Sequence[Payload] | None = option(
        (), "Body fixed to a frame, unknown to the controller", kind=PAYLOADS, group=ERRORS
    )
    mass_scale: MassScale = option(
        1.0,
        "Factor for the masses and inertias of all links, or factors by link, unknown to the controller",
        kind=FACTORS,
        group=ERRORS,
    )
    pushes: ExternalForce | Sequence[ExternalForce] = option(
        (), "External force [N] and moment [N m] on a frame", kind=PUSHES, group=JOINTS, flag="push"
    )
    sensors: Sensor | Sequence[Sensor] = option(
        (),
        "Sensors of the robot, which `Rollout.sensors` reads; controllers do not",
        kind=SENSORS,
        group=ERRORS,
        flag="-",
    )
    check_reference: bool = option(
        True,
        "Check of the reference, with an error if it violates position or velocity limits of the robot",
        kind=FLAG,
        group=REFERENCE,
        flag="-",
    )


FORMER_NAMES = {
    "damping": "joint_damping",
    "friction": "joint_friction",
    "armature": "joint_armature",
    "position_limits": "joint_limits",
}
"""Present names of options that had another one, in programs and in documents."""

OPTIONS = {each.name: each for each in options_of(SimulationOptions)}
"""Declarations of the options of a simulation by name."""


# -- functions whose arguments a dataclass declares ----------------------------------------------------


def check_arguments(
    name: str,
    signature: inspect.Signature,
    given: Iterable[Any],
    options: Mapping[str, Any],
    elsewhere: Mapping[str, str] = MappingProxyType({}),
    renamed: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Raise UnknownNameError for a keyword of `options` that the signature of the function `name` does not
    have, TypeError for other arguments that do not fit it.

    `elsewhere` has the option for each name under which other functions have it, `renamed` the present names
    of former keywords.
    """
    for each in options:
        if each not in signature.parameters:
            near = right_name(each, signature.parameters, renamed)
            clause = f"; here it is {elsewhere[each]}" if each in elsewhere else near
            raise UnknownNameError(f"{name} has no option {shown(each)}{clause}")
    try:
        signature.bind(*given, **options)
    except TypeError as error:
        raise TypeError(f"{name}: {error}") from None


def takes(
    arguments: Callable[P, A], renamed: Mapping[str, str] = MappingProxyType({}), **elsewhere: str
) -> Callable[[Callable[[A], R]], Callable[P, R]]:
    """Decorate a function of one object, so that it has the signature of the dataclass `arguments`.

    `renamed` has the present names of former keywords, `elsewhere` the option for each name under which other
    functions have it.

    Type checkers and `help` see the fields as arguments. A keyword that is no field raises UnknownNameError,
    other arguments that do not fit TypeError. The docstring gets a line for each field that `option`
    declares.
    """

    def decorate(function: Callable[[A], R]) -> Callable[P, R]:
        name = function.__name__
        signature = inspect.signature(arguments)

        @wraps(function)
        def called(*given: P.args, **options: P.kwargs) -> R:
            check_arguments(name, signature, given, options, elsewhere, renamed)
            return function(arguments(*given, **options))

        lines = [
            f"    - `{each.name}`: {each.metadata['option'].line}"
            for each in fields(cast(Any, arguments))
            if "option" in each.metadata
        ]
        if function.__doc__ and lines:
            called.__doc__ = "\n".join([function.__doc__.rstrip(), "", "    Options:", "", *lines, "    "])
        returned = inspect.signature(function).return_annotation
        called.__signature__ = signature.replace(return_annotation=returned)  # type: ignore[attr-defined]
        return called

    return decorate
