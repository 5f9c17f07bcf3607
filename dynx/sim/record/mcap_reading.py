"""Rollouts read back from the MCAP recordings that dynx writes."""

from __future__ import annotations

import json
import os
from collections import defaultdict
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, DynxError, shown
from dynx.files.reading import checked_path
from dynx.model import Model
from dynx.model.documents import robot_from_document
from dynx.sim.record.cdr import MessageReader
from dynx.sim.record.mcap_file import SCHEMA, read_messages
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

Messages = dict[str, list[tuple[int, bytes]]]
"""Time stamp [ns] and data of the messages of each topic."""


def load_mcap(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the fields of a rollout from a ``.mcap`` of `save`.

    Every number is that of the record, except times, which are whole nanoseconds. The scenario and what a
    scene holds besides the robot are not in a recording. Raises ArgumentError for any other file,
    NotInstalledError without mcap.
    """
    name = checked_path(path)
    try:
        found, about = read_messages(name)
        settings = about.get("dynx.rollout", {})
        if settings.get("schema") != SCHEMA:
            raise ArgumentError(f"{shown(name, 300)} is no recording of dynx, which writes {SCHEMA}")
        messages: Messages = defaultdict(list)
        for topic, stamp, data in found:
            messages[topic].append((stamp, data))
        return _fields(messages, settings)
    except DynxError as error:
        raise ArgumentError(f"{shown(name, 300)} cannot be read as a rollout: {error}") from error
    # Numbers of another length, topics that are missing, and text that is not JSON.
    except (ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
        raise ArgumentError(
            f"{shown(name, 300)} cannot be read as a rollout: {type(error).__name__}: {error}"
        ) from error


def _fields(messages: Messages, settings: dict[str, str]) -> dict[str, Any]:
    known = {key: json.loads(settings[key]) for key in ("gravity", "base_pose", "rotors")}
    description = MessageReader(messages["/robot_description"][0][1]).text()
    model = robot_from_document(
        {
            "urdf": description,
            "base": settings["base"],
            "gravity": known["gravity"],
            "base_pose": known["base_pose"],
        }
    )
    states = messages["/joint_states"]
    n = len(states) - 1
    q, v = _states(model, messages, "/joint_states", "/base/odometry", n + 1)
    a, tau = np.zeros((n, model.nv)), np.zeros((n, model.nv))
    saturated = np.zeros((n, model.nv), dtype=bool)
    base = 6 if model.floating else 0
    for k in range(n):
        tau[k, base:] = _joint_state(states[k][1])[2]
        a[k, base:] = _acceleration(messages["/accelerations"][k][1])
        saturated[k, base:] = _joint_state(messages["/saturated"][k][1])[2] > 0.5
        if base:
            a[k, :base] = _vectors(messages["/base/acceleration"][k][1])
            tau[k, :base] = _vectors(messages["/base/wrench"][k][1])
    return {
        "model": model,
        "t": np.array([stamp for stamp, _ in states]) * 1e-9,
        "q": q,
        "v": v,
        "a": a,
        "tau": tau,
        "saturated": saturated,
        "reference": _reference(model, messages, n + 1),
        "rotors": np.array(known["rotors"], dtype=np.float64).reshape(model.nv, model.nv),
    }


def _reference(model: Model, messages: Messages, n: int) -> Setpoint | None:
    if "/reference" not in messages:
        return None
    q, v = _states(model, messages, "/reference", "/base/reference", n)
    base = 6 if model.floating else 0
    a = np.zeros((n, model.nv))
    for k in range(n):
        a[k, base:] = _acceleration(messages["/reference_accelerations"][k][1])
        if base:
            a[k, :base] = _vectors(messages["/base/reference_acceleration"][k][1])
    return Setpoint(q, v, a)


def _states(model: Model, messages: Messages, joints: str, base: str, n: int) -> tuple[Floats, Floats]:
    """Return configurations (n, nq) and velocities (n, nv) of two topics."""
    q, v = np.zeros((n, model.nq)), np.zeros((n, model.nv))
    for k in range(n):
        position, velocity, _ = _joint_state(messages[joints][k][1])
        if model.floating:
            pose, twist = _odometry(messages[base][k][1])
            position, velocity = np.concatenate([pose, position]), np.concatenate([twist, velocity])
        q[k], v[k] = position, velocity
    return q, v


def _after_header(data: bytes) -> MessageReader:
    message = MessageReader(data)
    message.whole(), message.whole(), message.text()
    return message


def _joint_state(data: bytes) -> tuple[Floats, Floats, Floats]:
    """Return the positions, velocities and efforts of a JointState."""
    message = _after_header(data)
    message.texts()
    return message.numbers(), message.numbers(), message.numbers()


def _acceleration(data: bytes) -> Floats:
    """Return the accelerations of the only point of a JointTrajectory."""
    message = _after_header(data)
    message.texts()
    message.whole(), message.numbers(), message.numbers()
    return message.numbers()


def _odometry(data: bytes) -> tuple[Floats, Floats]:
    """Return the pose (7,) and the twist (6,) of an Odometry."""
    message = _after_header(data)
    message.text()
    pose, _ = message.numbers(7), message.numbers(36)
    return pose, message.numbers(6)


def _vectors(data: bytes) -> Floats:
    """Return the two vectors (6,) of a stamped message."""
    return _after_header(data).numbers(6)
