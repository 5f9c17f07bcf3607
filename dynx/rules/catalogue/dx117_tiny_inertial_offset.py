"""DX117 tiny-inertial-offset: MuJoCo drops the pose of an inertial frame that is off the link frame by less
than 1e-6.

MuJoCo stores the inertia of a body about its principal axes, the largest moment first, with the centre of
mass and the attitude of these axes in the body frame. When it compiles a model it marks frames that coincide
(``body_sameframe``), and then does not use the stored pose.

- MuJoCo 4.0.0 drops the attitude where each component of the vector part of its quaternion is below 1e-6,
  that is, a rotation by less than 2e-6 rad. If it does, it drops the centre of mass as well where each
  coordinate is below 1e-6 m. Rigidly connected links are merged before, so the pose is that of their sum,
  unless the file has ``<mujoco><compiler fusestatic="false"/></mujoco>``.
- Pinocchio 4.1.0, PyBullet 3.2.7 and Drake 1.51.1 use all numbers.

The effect: gravity torques of a balanced link vanish. A centre of mass at 7e-7 m was 2.3e-2 of the torques of
a robot whose links are balanced; beside heavy links it is 1e-7 of them and less. A rotation changes the mass
matrix by 1e-6 of the difference between the moments.

What to do: usually the offset is noise of a CAD program, and zero is meant. If the numbers are meant, clear
the marks after loading: ``model.body_sameframe[:] = model.body_simple[:] = model.dof_simplenum[:] = 0``. No
text of an ``<inertial>`` avoids them, because MuJoCo orders the axes itself.

dynx prints that line and proves it. ``--choose DX117=zero`` writes zero into the file instead, for all
engines; the report then says that the physics changed. Without a moving joint, on the floating base, the line
does not help, and zero is written.
"""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from dynx.model.elements import Inertial
from dynx.rules import Case, Detection, Remedy, Rule, links_of, measured_on
from dynx.rules.inertia import (
    CentralInertia,
    RigidGroup,
    line_of,
    merged_inertials,
    rigid_groups,
    with_inertials,
)
from dynx.spatial.extended import FLOAT64_EPS
from dynx.spatial.scalar import Floats

_THRESHOLD = 1e-6
"""Bound on each coordinate of the centre of mass [m] and of the vector part of the quaternion."""

_NEGLIGIBLE = 1e-14
"""Offset [m] and relative change of the tensor that are not reported."""

_ROUNDING = 8.0 * FLOAT64_EPS
"""Products of inertia, relative to the largest moment, with which MuJoCo does not rotate the axes."""

_ORDER = 1e-12
"""Relative difference of two moments up to which MuJoCo does not exchange their axes."""

_CALL = "mujoco.exact_inertial_frames"


class TinyInertialOffset(Rule):
    engines = measured_on("mujoco")
    advice = "Write zero if the offset is noise; else clear MuJoCo's marks after loading."
    choices = {
        "call": "clear the marks in MuJoCo after loading",
        "zero": "write zero for what MuJoCo drops; this changes the physics",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first link of each moving rigid group whose inertial frame MuJoCo drops."""
        if _CALL in case.calls:
            return
        for group, body in _moving_bodies(case):
            message = _dropped(body)
            if message:
                yield Detection(group.head, None, line_of(case, group.head, "origin"), message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Add the call, or write zero, as chosen; only the latter helps where no joint moves."""
        if self.chosen(case) == "call" and any(joint.moves for joint in case.model.joints):
            done = "gave MuJoCo the inertial frames of the file"
            return Remedy(case.with_calls(_CALL), done, self.decision(case))
        for name in links_of(detections):
            group = rigid_groups(case)[name]
            held = [each for each in group.links if case.inertials[each] is not None]
            merged = merged_inertials(case, group, held, name) if held != [name] else {}
            whole = merged.get(name) or case.model.inertial(name)
            case = with_inertials(case, merged | {name: _without_offset(whole)})
        done = "wrote zero for offsets of inertial frames below 1e-6"
        return Remedy(case, done, self.decision(case), changes_physics=True)


def _moving_bodies(case: Case) -> Iterator[tuple[RigidGroup, CentralInertia]]:
    """Yield each moving rigid group with mass, and its inertia in the frame of its head."""
    for group in dict.fromkeys(rigid_groups(case).values()):
        total: CentralInertia | None = None
        for name in () if group.static else group.links:
            inertial = case.inertials[name]
            if inertial is not None:
                part = CentralInertia.of(inertial).transform(*group.poses[name])
                total = part if total is None else total + part
        if total is not None and total.mass > 0.0 and total.tensor.any():
            yield group, total


def _dropped(body: CentralInertia) -> str:
    """Describe what MuJoCo drops of the pose of the principal axes; empty for nothing that matters."""
    center, tensor = np.abs(body.center.astype(np.float64)), _rounded(body.tensor.astype(np.float64))
    moments, axes = CentralInertia(body.mass, body.center, tensor).principal()
    largest = float(np.max(moments))
    if np.any(np.diff(moments) > _ORDER * largest):
        return ""  # MuJoCo exchanges axes, and so keeps the attitude.
    R = axes.astype(np.float64)
    vector = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 4.0
    if np.any(np.abs(vector) >= _THRESHOLD) or np.trace(R) < 2.0:
        return ""
    change = float(np.max(np.abs(tensor - np.diag(np.diagonal(tensor))))) / largest
    parts = []
    if np.all(center < _THRESHOLD) and np.max(center) > _NEGLIGIBLE:
        parts.append(f"a centre of mass {float(np.linalg.norm(center)):.2g} m off the link frame")
    if change > _NEGLIGIBLE:
        parts.append(f"principal axes rotated by {2.0 * float(np.linalg.norm(vector)):.2g} rad")
    return f"MuJoCo drops {' and '.join(parts)}" if parts else ""


def _rounded(tensor: Floats) -> Floats:
    """Return the tensor without products of inertia that are rounding."""
    small = np.abs(tensor) <= _ROUNDING * np.max(np.abs(tensor))
    return np.where(small & ~np.eye(3, dtype=bool), 0.0, tensor)


def _without_offset(inertial: Inertial) -> Inertial:
    """Return the inertial with its frame in that of the link, where MuJoCo drops the difference."""
    tensor = CentralInertia.of(inertial)
    x, y, z = (float(value) for value in np.diagonal(tensor.tensor))
    center = tensor.center.astype(np.float64)
    at_origin = bool(np.all(np.abs(center) < _THRESHOLD))
    origin = inertial.origin
    xyz = (0.0, 0.0, 0.0) if at_origin else origin.xyz
    return Inertial(inertial.mass, type(origin)(xyz, (0.0, 0.0, 0.0)), ixx=x, iyy=y, izz=z)
