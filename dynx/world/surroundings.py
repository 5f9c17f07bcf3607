"""The record of a rollout in a scene besides its robot: contacts, bodies, and the other robots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.errors import UnknownNameError, nearest, shown
from dynx.files.arrays import ArrayFile
from dynx.model.numbers import whole_number
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross
from dynx.world.contacts import Contact

Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ContactTable:
    """All contacts of a rollout, a row each, in the order of the steps.

    Row k is a contact between ``names[a[k]]`` and ``names[b[k]]`` in the last sub-step of step ``step[k]``,
    which begins at ``t[step[k]]``. The other arrays are as in `dynx.world.Contact`, in world axes.
    """

    n_steps: int
    """Number of steps of the rollout."""
    names: tuple[str, ...]
    """All bodies and links (``robot/link``) of the scene."""
    step: Integers
    a: Integers
    b: Integers
    point_a: Floats
    """Points (m, 3) on the surfaces of a [m]."""
    point_b: Floats
    normal: Floats
    """Unit vectors (m, 3) from b to a."""
    distance: Floats
    """Distances (m,) [m]; negative for penetration."""
    normal_force: Floats
    """Forces (m,) along the normals, on a [N]."""
    friction_force: Floats
    """Forces (m, 3) on a, perpendicular to the normals [N]."""

    @classmethod
    @checks_types
    def of(cls, steps: Sequence[Sequence[Contact]], parts: Sequence[str]) -> ContactTable:
        """Return the table of the contacts of each step; `parts` are the bodies and links of the scene."""
        listed = [(k, contact) for k, contacts in enumerate(steps) for contact in contacts]
        number = {name: k for k, name in enumerate(parts)}
        vectors = {
            name: np.array([getattr(contact, name) for _, contact in listed]).reshape(-1, 3)
            for name in ("point_a", "point_b", "normal", "friction_force")
        }
        numbers = {
            name: np.array([getattr(contact, name) for _, contact in listed], dtype=np.float64)
            for name in ("distance", "normal_force")
        }
        return cls(
            n_steps=len(steps),
            names=tuple(parts),
            step=np.array([k for k, _ in listed], dtype=np.int64),
            a=np.array([number[contact.a] for _, contact in listed], dtype=np.int64),
            b=np.array([number[contact.b] for _, contact in listed], dtype=np.int64),
            **vectors,
            **numbers,
        )

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.step)

    def __getitem__(self, step: int) -> tuple[Contact, ...]:
        """Return the contacts of one step."""
        return tuple(self._row(k) for k in np.flatnonzero(self.step == step).tolist())

    def _row(self, k: int) -> Contact:
        return Contact(
            self.names[self.a[k]],
            self.names[self.b[k]],
            self.point_a[k],
            self.point_b[k],
            self.normal[k],
            float(self.distance[k]),
            float(self.normal_force[k]),
            self.friction_force[k],
        )

    @property
    def touching(self) -> tuple[str, ...]:
        """Bodies and links that touch something at some time."""
        numbers = np.unique(np.concatenate([self.a, self.b])).tolist()
        return tuple(self.names[number] for number in numbers)

    def force_on(self, part: str) -> Floats:
        """Return the sum of the contact forces on a part in each step (n_steps, 3) [N], in world axes.

        A part is a body, ``robot/link``, or a robot for all its links. Raises UnknownNameError for another.
        """
        return self.wrenches_on(part)[:, :3]

    @checks_types
    def wrenches_on(self, part: str) -> Floats:
        """Return the sum of the contact forces on a part in each step and of their moments about the origin
        of the world (n_steps, 6) [N, N m], in world axes; see `force_on`."""
        own = np.array([name == part or name.startswith(f"{part}/") for name in self.names])
        if not own.any():
            known = dict.fromkeys([*self.names, *(name.partition("/")[0] for name in self.names)])
            raise UnknownNameError(f"no part {shown(part)}{nearest(part, known)}")
        total = np.zeros((self.n_steps, 6))
        force = self.normal_force[:, None] * self.normal + self.friction_force
        wrench = np.concatenate([force, cross(0.5 * (self.point_a + self.point_b), force)], axis=1)
        for side, sign in ((self.a, 1.0), (self.b, -1.0)):
            rows = own[side]
            np.add.at(total, self.step[rows], sign * wrench[rows])
        return total

    def first(self, n: int) -> ContactTable:
        """Return the contacts of the first `n` steps."""
        whole_number("n", n, 0)
        end = int(np.searchsorted(self.step, n))
        return ContactTable(n, self.names, **{name: getattr(self, name)[:end] for name in _COLUMNS})


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Contacts of n steps, and at n + 1 times the poses of bodies and the configurations of other robots."""

    contacts: ContactTable
    bodies: Mapping[str, Floats]
    """Pose (n + 1, 4, 4) of each body of the scene that moves."""
    robots: Mapping[str, Floats]
    """Configurations (n + 1, nq) of the other robots of the scene."""
    notes: tuple[str, ...] = ()
    """Notes of the world at the start (`dynx.world.World.notes`); none in files of earlier versions."""

    def first(self, n: int) -> Surroundings:
        """Return the record of the first `n` steps."""
        contacts = self.contacts.first(n)
        bodies, robots = (
            {name: rows[: n + 1] for name, rows in parts.items()} for parts in (self.bodies, self.robots)
        )
        return Surroundings(contacts, bodies, robots, self.notes)

    def __repr__(self) -> str:
        counts = f"contacts: {len(self.contacts)}, moving bodies: {len(self.bodies)}"
        return f"<Surroundings: {counts}, other robots: {len(self.robots)}>"


def to_document(surroundings: Surroundings) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the names as a document, and the arrays of a file by name; `from_document` is the inverse."""
    table = surroundings.contacts
    names: dict[str, Any] = {"contacts": list(table.names), "notes": list(surroundings.notes)}
    names |= {kind: [*getattr(surroundings, kind)] for kind in _PARTS}
    arrays = {f"contact_{name}": getattr(table, name) for name in _COLUMNS}
    for kind in _PARTS:
        arrays |= {f"{kind}_{k}": rows for k, rows in enumerate(getattr(surroundings, kind).values())}
    return names, arrays


def from_document(document: Mapping[str, Any], file: ArrayFile, n: int) -> Surroundings:
    """Return the surroundings over `n` steps from what `to_document` returned, read from a file.

    Raises ArgumentError for arrays of other shapes, and KeyError, TypeError or ValueError for a document of
    another form.
    """
    names = tuple(map(str, document["contacts"]))
    arrays = {name: file.array(f"contact_{name}", shape, kind) for name, (shape, kind) in _COLUMNS.items()}
    m = len(arrays["step"])
    lengths = {len(rows) for rows in arrays.values()}
    numbers = np.concatenate([arrays["a"], arrays["b"]])
    in_order = np.all(np.diff(arrays["step"]) >= 0) and np.all((arrays["step"] >= 0) & (arrays["step"] < n))
    if lengths != {m} or not in_order or not np.all((numbers >= 0) & (numbers < len(names))):
        raise ValueError("its contacts do not fit together")
    parts = {
        kind: {str(name): file.array(f"{kind}_{k}", (n + 1, *shape)) for k, name in enumerate(document[kind])}
        for kind, shape in _PARTS.items()
    }
    notes = tuple(map(str, document.get("notes", ())))
    return Surroundings(ContactTable(n, names, **arrays), parts["bodies"], parts["robots"], notes)


_COLUMNS: dict[str, tuple[tuple[int | None, ...], type]] = {
    **dict.fromkeys(("step", "a", "b"), ((None,), np.int64)),
    **dict.fromkeys(("point_a", "point_b", "normal", "friction_force"), ((None, 3), float)),
    **dict.fromkeys(("distance", "normal_force"), ((None,), float)),
}
"""Shape and type of the columns of a table of contacts."""

_PARTS: dict[str, tuple[int | None, ...]] = {"bodies": (4, 4), "robots": (None,)}
"""Shape of a row for each kind of part."""
