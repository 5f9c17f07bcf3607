"""Moving inertia between links welded together, which is the same rigid body."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from dynx.model.elements import Inertial
from dynx.rules.case import Case
from dynx.rules.inertia.central import CentralInertia
from dynx.rules.inertia.rigid_groups import RigidGroup


def written(case: Case, link: str, body: CentralInertia, old: Inertial | None = None) -> Inertial:
    """A body as the ``<inertial>`` of a link: in principal form, but for the root on the fixed base.

    There PyBullet takes the attitude of the inertial frame for that of the base (DX106).
    """
    if case.base == "fixed" and link == case.model.root:
        return body.aligned()
    return body.inertial(near=(0.0, 0.0, 0.0) if old is None else old.origin.rpy)


def lumped_into(case: Case, group: RigidGroup, links: Sequence[str], into: str) -> dict[str, Inertial]:
    """New inertials for some links of a group: all in the link `into`, nothing in the others."""
    body = _lumped(case, group, links, into)
    bodies = {into: written(case, into, body, case.inertials[into])}
    for name in links:
        inertial = case.inertials[name]
        if name != into and inertial is not None:
            bodies[name] = _without_mass(inertial)
    return bodies


def _without_mass(inertial: Inertial) -> Inertial:
    """The same element with a mass and moments of zero; its origin stays."""
    return Inertial(0.0, inertial.origin)


def _lumped(case: Case, group: RigidGroup, links: Iterable[str], into: str) -> CentralInertia:
    """The inertia of links of a group together, in the frame of the link `into`."""
    total: CentralInertia | None = None
    # The link itself first: where nothing has mass its centre stays.
    for name in sorted(links, key=lambda name: name != into):
        inertial = case.inertials[name]
        if inertial is not None:
            part = CentralInertia.of(inertial).transform(*group.pose(name, into))
            total = part if total is None else total + part
    return CentralInertia.of(Inertial()) if total is None else total
