"""Inertia moved between rigidly connected links, which leaves the rigid body unchanged."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dynx.model.elements import Inertial
from dynx.rules.case import Case
from dynx.rules.inertia.central import CentralInertia
from dynx.rules.inertia.rigid_groups import RigidGroup


def as_inertial(case: Case, link: str, body: CentralInertia, old: Inertial | None = None) -> Inertial:
    """Return the ``<inertial>`` of a link with this body, in principal form unless the link is a fixed root.

    There PyBullet mistakes the attitude of the inertial frame for that of the base (DX106).
    """
    if case.base == "fixed" and link == case.model.root:
        return body.aligned()
    return body.inertial(near=(0.0, 0.0, 0.0) if old is None else old.origin.rpy)


def merged_inertials(case: Case, group: RigidGroup, links: Sequence[str], into: str) -> dict[str, Inertial]:
    """Merge the inertials of some links of a group: the sum in the link `into`, zero in the others."""
    body = _sum(case, group, links, into)
    bodies = {into: as_inertial(case, into, body, case.inertials[into])}
    for name in links:
        inertial = case.inertials[name]
        if name != into and inertial is not None:
            bodies[name] = _without_mass(inertial)
    return bodies


def _without_mass(inertial: Inertial) -> Inertial:
    """Return the inertial with mass and moments of zero; its origin is kept."""
    return Inertial(0.0, inertial.origin)


def _sum(case: Case, group: RigidGroup, links: Iterable[str], into: str) -> CentralInertia:
    """Return the inertia of some links of a group together, in the frame of the link `into`."""
    total: CentralInertia | None = None
    # The link itself first, so that its centre of mass is kept where no link has mass.
    for name in sorted(links, key=lambda name: name != into):
        inertial = case.inertials[name]
        if inertial is not None:
            part = CentralInertia.of(inertial).transform(*group.pose(name, into))
            total = part if total is None else total + part
    return CentralInertia.of(Inertial()) if total is None else total
