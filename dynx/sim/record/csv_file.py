"""Rollouts as tables of text, for spreadsheets and programs without NumPy's formats.

The first line names the columns, in this order; ``c`` stands for each coordinate:

| columns | content | unit |
|---|---|---|
| `t` | time | s |
| `q:c`, `v:c` | position, velocity | rad, m, per second |
| `q*:c`, `v*:c`, `a*:c`, `error:c` | reference and error, if there is a reference | likewise |
| `energy` | kinetic and potential | J |
| `a:c`, `tau:c` | acceleration and torque in the step that starts at this time | per second squared; N m, N |
| `saturated:c` | 1 if the motor was at its limit in that step, otherwise 0 | |
| `contact:name:x`, `:y`, `:z` | sum of the contact forces on a body or link in that step, world axes | N |

Coordinates have the names of their joints. A floating base comes first: `x y z qx qy qz qw` in positions (of
the base frame in the world, quaternion xyzw) and `vx vy vz wx wy wz` in rates (in the base frame). No step
begins at the last state, so its last columns are empty. Numbers are the shortest text that reads back as the
same float64. Text is UTF-8, and a name with a comma or a quote in it stands in quotes (RFC 4180).
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from dynx.model import Model
from dynx.sim.record.rollout_data import RolloutData
from dynx.spatial.scalar import Floats


def write_csv(rollout: RolloutData, file: BinaryIO) -> None:
    """Write one row for each state, with the torque and acceleration of the step that begins there."""
    model = rollout.model
    positions, rates = coordinate_names(model)
    header = ["t", *_named("q", positions), *_named("v", rates)]
    blocks = [rollout.t[:, None], rollout.q, rollout.v]
    if rollout.reference is not None:
        header += [*_named("q*", positions), *_named("v*", rates), *_named("a*", rates)]
        header += _named("error", rates)
        blocks += [*rollout.reference, rollout.error]
    header += ["energy", *_named("a", rates), *_named("tau", rates), *_named("saturated", rates)]
    blocks.append(rollout.energy[:, None])
    states = np.concatenate(blocks, axis=1)
    acting = np.concatenate([rollout.a, rollout.tau], axis=1)
    forces = np.zeros((len(rollout), 0))
    if rollout.surroundings is not None:
        contacts = rollout.surroundings.contacts
        header += [f"contact:{name}:{axis}" for name in contacts.touching for axis in "xyz"]
        each = [contacts.force_on(name) for name in contacts.touching]
        forces = np.concatenate([forces, *each], axis=1)
    nothing = [""] * (3 * model.nv + forces.shape[1])
    file.write((",".join(_quoted(column) for column in header) + "\n").encode())
    for k, state in enumerate(states):
        cells = [repr(x) for x in state.tolist()]
        if k < len(acting):
            cells += [repr(x) for x in acting[k].tolist()]
            cells += ["1" if flag else "0" for flag in rollout.saturated[k].tolist()]
            cells += [repr(x) for x in forces[k].tolist()]
        else:
            cells += nothing
        file.write((",".join(cells) + "\n").encode())


def columns(rollout: RolloutData) -> dict[str, Floats]:
    """Return the columns (n + 1,) of states and steps in the table of a rollout, for `pandas.DataFrame`.

    The columns of steps (``a:``, ``tau:``, ``saturated:``) end with NaN, because no step begins at the last
    state.
    """
    model = rollout.model
    positions, rates = coordinate_names(model)
    found = {"t": rollout.t}
    blocks = [("q", positions, rollout.q), ("v", rates, rollout.v)]
    if rollout.reference is not None:
        blocks += [("q*", positions, rollout.reference.q), ("v*", rates, rollout.reference.v)]
        blocks += [("a*", rates, rollout.reference.a), ("error", rates, rollout.error)]
    last = np.full((1, model.nv), np.nan)
    for kind, steps in (("a", rollout.a), ("tau", rollout.tau), ("saturated", rollout.saturated)):
        blocks.append((kind, rates, np.concatenate([steps, last])))
    for kind, names, block in blocks:
        found |= dict(zip(_named(kind, names), block.T, strict=True))
    return found


def coordinate_names(model: Model) -> tuple[list[str], list[str]]:
    """Return the names of the columns of positions and of rates."""
    positions, rates = (["x", "y", "z", "qx", "qy", "qz", "qw"], ["vx", "vy", "vz", "wx", "wy", "wz"])
    joints = list(model.joint_names)
    return [*(positions if model.floating else []), *joints], [*(rates if model.floating else []), *joints]


def _named(kind: str, coordinates: list[str]) -> list[str]:
    return [f"{kind}:{name}" for name in coordinates]


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n\r') else text
