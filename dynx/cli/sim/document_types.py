"""The JSON documents of ``dynx sim``: their keys and types, from which their schemas are generated.

Lengths are in m, angles in rad, torques in N m or N; errors are null without a reference.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict


class BodyErrorPart(TypedDict):
    """Norm of a position or rotation error: its maximum, the time of that, and its final value."""

    max: float
    max_time: float
    final: float


class BodyError(TypedDict):
    """Error of a floating base or of a frame."""

    position: BodyErrorPart
    rotation: BodyErrorPart


class JointEntry(TypedDict):
    """Coordinate of v, those of a floating base first; `saturated` is the fraction of steps at the limit."""

    name: str
    unit: Literal["rad", "m"]
    max_error: float | None
    rms_error: float | None
    final_error: float | None
    max_speed: float
    max_torque: float
    effort_limit: float | None
    saturated: float


class SimulationEnd(TypedDict):
    """Reason why a simulation ended early, and the state there."""

    type: str
    message: str
    time: float
    step: int
    q: list[float]
    v: list[float]


class PayloadEntry(TypedDict):
    """A mass [kg] rigidly connected to a frame, with its center in that frame."""

    frame: str
    mass: float
    center: list[float]


class FinalState(TypedDict):
    """Last state of the record."""

    t: float
    q: list[float]
    v: list[float]


class SimDocument(TypedDict):
    """One simulation with its options and results; `settings` are the main settings of its scenario."""

    schema: int
    dynx: str
    robot: str
    source: str | None
    base: str
    base_pose: list[float]
    gravity: list[float]
    nq: int
    nv: int
    law: str
    backend: str | None
    frame: str | None
    frame_given: bool
    motion: dict[str, Any]
    gains: dict[str, Any]
    motor_limits: list[float] | None
    settings: dict[str, Any]
    payload: list[PayloadEntry]
    mass_scale: float | dict[str, float]
    total_mass: float
    passive: bool
    status: Literal["done", "diverged", "control failed", "interrupted"]
    error: SimulationEnd | None
    overshoot: dict[str, Any] | None
    dt: float
    steps: int
    steps_asked: int
    simulated: float
    seconds: float
    max_error: float | None
    max_error_joint: str | None
    max_error_time: float | None
    rms_error: float | None
    final_error: float | None
    energy_change: float
    energy_drift: float
    max_kinetic_energy: float
    saturated: float
    base_error: BodyError | None
    frame_error: BodyError | None
    joints: list[JointEntry]
    final: FinalState
    files: list[str]


class ModeOnPlant(TypedDict):
    """Tracking errors of one mode of control on one plant; null where it failed, for the reason `problem`."""

    max_error: float | None
    rms_error: float | None
    final_error: float | None
    joint_max_errors: list[float] | None
    steps: int
    problem: str | None


class ModeEntry(TypedDict):
    """One mode of control on each plant."""

    mode: str
    what: str
    plants: dict[str, ModeOnPlant]


TutorialEnds = TypedDict("TutorialEnds", {"from": list[float], "to": list[float]})


class TutorialDocument(TutorialEnds):
    """All modes of control on one motion; `not_done` are the modes that an interrupted run left out."""

    schema: int
    dynx: str
    robot: str
    source: str | None
    base: str
    gravity: list[float]
    joint_names: list[str]
    duration: float
    dt: float
    plants: list[str]
    backend: str
    kp: float
    kd: float
    modes: list[ModeEntry]
    not_done: list[str]
