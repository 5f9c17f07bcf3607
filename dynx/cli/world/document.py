"""The JSON document of ``dynx world``: lengths in m, angles in rad, forces in N, times in s, world axes."""

from __future__ import annotations

from typing import Any, Literal, TypedDict

from dynx.spatial.so3 import quat_from_rotation
from dynx.world.comparison import SEPARATIONS, EngineRun, WorldComparison
from dynx.world.contacts import Contact
from dynx.world.separation import Separation

SCHEMA: Literal["dynx.world/1"] = "dynx.world/1"


class RobotEntry(TypedDict):
    """State of a robot in the coordinates of its model."""

    name: str
    joints: list[str]
    q: list[float]
    v: list[float]


class BodyEntry(TypedDict):
    """State of a body: position and quaternion (x, y, z, w) of its frame, linear and angular velocity."""

    name: str
    position: list[float]
    quat_xyzw: list[float]
    twist: list[float]


class ContactEntry(TypedDict):
    """A contact of the last step; the force on `a` is normal_force * normal + friction_force."""

    a: str
    b: str
    point: list[float]
    normal: list[float]
    distance: float
    normal_force: float
    friction_force: list[float]


class EngineEntry(TypedDict):
    """Run of the scene by one engine; `error` is why it ended early, `notes` name overlaps and violated
    constraints of the start."""

    engine: str
    version: str
    settings: dict[str, Any]
    time: float
    error: str | None
    notes: list[str]
    robots: list[RobotEntry]
    bodies: list[BodyEntry]
    contacts: list[ContactEntry]


class PartedEntry(TypedDict):
    """First of the compared times at which two engines are farther apart than `distance`; null for never."""

    distance: float
    time: float | None


class SeparationEntry(TypedDict):
    """Largest distance between the positions of a body or moving link in two engines, over time."""

    engines: list[str]
    times: list[float]
    distance: list[float]
    farthest: list[str]
    parted: list[PartedEntry]


class WorldDocument(TypedDict):
    """One scene run by one engine or several."""

    schema: Literal["dynx.world/1"]
    scene: str
    dt: float
    substeps: int
    duration: float
    engines: list[EngineEntry]
    separations: list[SeparationEntry]


def document(comparison: WorldComparison) -> WorldDocument:
    """Return the document of a comparison."""
    return {
        "schema": SCHEMA,
        "scene": comparison.scene.name,
        "dt": comparison.dt,
        "substeps": comparison.substeps,
        "duration": comparison.duration,
        "engines": [_engine(comparison, run) for run in comparison.runs],
        "separations": [_separation(each) for each in comparison.separations],
    }


def _engine(comparison: WorldComparison, run: EngineRun) -> EngineEntry:
    last, scene = run.states[-1], comparison.scene
    moving = [body.name for body in scene.bodies if not body.fixed]
    return {
        "engine": run.engine,
        # Most versions begin with the name of the engine.
        "version": run.version.removeprefix(run.engine).strip(),
        "settings": dict(run.settings),
        "time": last.time,
        "error": "interrupted" if run.interrupted else None if run.error is None else str(run.error),
        "notes": list(run.notes),
        "robots": [
            {
                "name": robot.name,
                "joints": list(robot.model.joint_names),
                "q": last.robots[robot.name].q.tolist(),
                "v": last.robots[robot.name].v.tolist(),
            }
            for robot in scene.robots
        ],
        "bodies": [
            {
                "name": name,
                "position": last.bodies[name].T_world_body[:3, 3].tolist(),
                "quat_xyzw": quat_from_rotation(last.bodies[name].T_world_body[:3, :3]).tolist(),
                "twist": last.bodies[name].twist.tolist(),
            }
            for name in moving
        ],
        "contacts": [_contact(each) for each in run.contacts],
    }


def _contact(contact: Contact) -> ContactEntry:
    return {
        "a": contact.a,
        "b": contact.b,
        "point": contact.point.tolist(),
        "normal": contact.normal.tolist(),
        "distance": contact.distance,
        "normal_force": contact.normal_force,
        "friction_force": contact.friction_force.tolist(),
    }


def _separation(separation: Separation) -> SeparationEntry:
    return {
        "engines": list(separation.records),
        "times": separation.times.tolist(),
        "distance": separation.distance.tolist(),
        "farthest": list(separation.parts),
        "parted": [_parted(separation, each) for each in SEPARATIONS],
    }


def _parted(separation: Separation, distance: float) -> PartedEntry:
    time, _ = separation.first_beyond(distance) or (None, "")
    return {"distance": distance, "time": time}
