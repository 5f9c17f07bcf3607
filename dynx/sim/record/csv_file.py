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

from dynx.sim.record.rollout_data import RolloutData


def write_csv(rollout: RolloutData, file: BinaryIO) -> None:
    """Write one row for each state, with the torque and acceleration of the step that begins there."""
    model = rollout.model
    positions = [*(["x", "y", "z", "qx", "qy", "qz", "qw"] if model.floating else []), *model.joint_names]
    rates = [*(["vx", "vy", "vz", "wx", "wy", "wz"] if model.floating else []), *model.joint_names]
    columns = ["t", *_named("q", positions), *_named("v", rates)]
    blocks = [rollout.t[:, None], rollout.q, rollout.v]
    if rollout.reference is not None:
        columns += [*_named("q*", positions), *_named("v*", rates), *_named("a*", rates)]
        columns += _named("error", rates)
        blocks += [*rollout.reference, rollout.error]
    columns += ["energy", *_named("a", rates), *_named("tau", rates), *_named("saturated", rates)]
    blocks.append(rollout.energy[:, None])
    states = np.concatenate(blocks, axis=1)
    acting = np.concatenate([rollout.a, rollout.tau], axis=1)
    forces = np.zeros((len(rollout), 0))
    if rollout.surroundings is not None:
        contacts = rollout.surroundings.contacts
        columns += [f"contact:{name}:{axis}" for name in contacts.touching for axis in "xyz"]
        each = [contacts.force_on(name) for name in contacts.touching]
        forces = np.concatenate([forces, *each], axis=1)
    nothing = [""] * (3 * model.nv + forces.shape[1])
    file.write((",".join(_quoted(column) for column in columns) + "\n").encode())
    for k, state in enumerate(states):
        cells = [repr(x) for x in state.tolist()]
        if k < len(acting):
            cells += [repr(x) for x in acting[k].tolist()]
            cells += ["1" if flag else "0" for flag in rollout.saturated[k].tolist()]
            cells += [repr(x) for x in forces[k].tolist()]
        else:
            cells += nothing
        file.write((",".join(cells) + "\n").encode())


def _named(kind: str, coordinates: list[str]) -> list[str]:
    return [f"{kind}:{name}" for name in coordinates]


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if any(c in text for c in ',"\n\r') else text
