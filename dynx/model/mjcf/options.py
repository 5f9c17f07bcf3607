"""Options of MJCF: ``<option>`` and its flags, those that change the robot apart from those of MuJoCo's step.

Flags that remove gravity, damping, dry friction, springs, actuators and their control ranges, contacts or
equality constraints have their effect.
Each other one that a file states has a note.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from dynx.model.elements import Vector
from dynx.model.tree import STANDARD_GRAVITY
from dynx.model.xml.reading import Element
from dynx.model.xml.several_files import FilesReading

_PARTS_OF = {
    "constraint": frozenset(["equality", "frictionloss", "limit", "contact"]),
    # MuJoCo had this one until it divided it into those of springs and dampers.
    "passive": frozenset(["spring", "damper"]),
}
"""Flags that disable others at once."""

_OF_ROBOTS = frozenset(
    [
        "actuation",
        "clampctrl",
        "constraint",
        "contact",
        "damper",
        "equality",
        "filterparent",
        "frictionloss",
        "gravity",
        "limit",
        "override",
        "passive",
        "spring",
    ]
)
_ENABLED_AT_FIRST = frozenset(
    [
        "autoreset",
        "eulerdamp",
        "island",
        "midphase",
        "multiccd",
        "nativeccd",
        "refsafe",
        "sensor",
        "warmstart",
    ]
)
_DISABLED_AT_FIRST = frozenset(
    ["diagexact", "energy", "fwdinv", "invdiscrete", "ipc", "sensornoise", "sleep", "speculative"]
)
FLAGS = _OF_ROBOTS | _ENABLED_AT_FIRST | _DISABLED_AT_FIRST
"""Flags of MuJoCo 4.0, and those of older versions: passive and sensornoise."""

_MEDIUM = ("density", "viscosity", "wind")
_SETTINGS = frozenset(
    [
        "actuatorgroupdisable",
        "apirate",
        "ccd_iterations",
        "ccd_tolerance",
        "collision",
        "cone",
        "impratio",
        "integrator",
        "iterations",
        "jacobian",
        "ls_iterations",
        "ls_tolerance",
        "magnetic",
        "mpr_iterations",
        "mpr_tolerance",
        "noslip_iterations",
        "noslip_tolerance",
        "o_friction",
        "o_margin",
        "o_solimp",
        "o_solref",
        "sdf_initpoints",
        "sdf_iterations",
        "sleep_tolerance",
        "solver",
        "timestep",
        "tolerance",
    ]
)
"""Attributes of ``<option>`` for a simulation by MuJoCo. Older versions have apirate, collision and mpr."""

_OF_ONE_ROBOT = {
    "contact": "contacts are disabled in MuJoCo; the robot has its collision shapes all the same",
    "filterparent": "parent and child may touch in MuJoCo; dynx decides which links may touch",
    "equality": "equality constraints are disabled, and none is read",
}


@dataclass(frozen=True)
class MjcfOptions:
    """The options that a file states: the last one, where several do."""

    gravity: Vector
    flags: Mapping[str, tuple[bool, Element]]
    """Whether each flag that is stated is enabled, and the element that says so."""
    settings: Mapping[str, Element]
    """Attributes of ``<option>`` for a simulation by MuJoCo, each with its element."""

    def disabled(self, flag: str) -> Element | None:
        """Return the element that disables a flag, alone or with others; None for an enabled one."""
        for name in (flag, *(each for each, parts in _PARTS_OF.items() if flag in parts)):
            enabled, element = self.flags.get(name, (True, None))
            if not enabled:
                return element
        return None

    def note(self, reading: FilesReading, *, scene: bool) -> None:
        """Add notes on flags, and on the settings of a `scene`, whose step is that of its world."""
        for flag, effect in (
            ("damper", "dampers are disabled: no joint has damping"),
            ("spring", "springs are disabled: no joint has a spring"),
            ("frictionloss", "dry friction is disabled: no joint has friction"),
            ("actuation", "actuators are disabled, and none is read"),
            ("clampctrl", "controls are not limited: no actuator has a range of its control"),
            ("limit", "limits are disabled in MuJoCo; the joints have theirs all the same"),
            *(() if scene else _OF_ONE_ROBOT.items()),
        ):
            element = self.disabled(flag)
            if element is not None:
                reading.note(element, f"<flag>: {effect}")
        if "actuatorgroupdisable" in self.settings and not scene:
            reading.note(
                self.settings["actuatorgroupdisable"],
                "actuatorgroupdisable is not read: model.actuators also has the actuators of these groups",
            )
        enabled, element = self.flags.get("override", (False, None))
        if enabled and element is not None:
            reading.note(element, "<flag>: override is not read; contacts have the parameters of their geoms")
        stated = {
            name: element
            for name, (enabled, element) in self.flags.items()
            if name not in _OF_ROBOTS and enabled == (name in _DISABLED_AT_FIRST)
        }
        if scene:
            stated = {**self.settings, **stated}
        if stated:
            whose = "; step and settings are those of the World" if scene else ""
            reading.note(
                next(iter(stated.values())),
                f"settings of MuJoCo's simulation are not read: {', '.join(stated)}{whose}",
            )


def read_options(root: Element, reading: FilesReading) -> MjcfOptions:
    """Read all ``<option>`` of a document, with a note on the air or water around.

    Raises DescriptionError for unknown attributes and flags, which MuJoCo refuses, too.
    """
    gravity = STANDARD_GRAVITY
    flags: dict[str, tuple[bool, Element]] = {}
    settings: dict[str, Element] = {}
    for option in root.all("option"):
        reading.require_known_attributes(option, sorted({"gravity", *_MEDIUM, *_SETTINGS}))
        reading.ignore_unknown(option, ["flag"])
        if "gravity" in option.attributes:
            gravity = reading.vector(option, "gravity", "<option>")
        for attribute in _MEDIUM:
            if attribute in option.attributes and any(
                reading.numbers(option, attribute, "<option>", 3 if attribute == "wind" else 1)
            ):
                reading.note(option, f"{attribute} of the air or water around is not read: it does not brake")
        settings |= {name: option for name in option.attributes if name in _SETTINGS}
        for flag in option.all("flag"):
            reading.require_known_attributes(flag, sorted(FLAGS))
            for name in flag.attributes:
                word = reading.choice(flag, name, "<flag>", ("enable", "disable"), "enable")
                flags[name] = (word == "enable", flag)
    if not flags.get("gravity", (True, None))[0]:
        gravity = (0.0, 0.0, 0.0)
    return MjcfOptions(gravity, flags, settings)
