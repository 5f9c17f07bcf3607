"""Links that a joint moves and that have neither mass nor moments of inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dynx.model.elements import IDENTITY, Inertial
from dynx.rules.case import Case
from dynx.rules.inertia.edits import with_inertials
from dynx.rules.inertia.physical import ACCEPTED_MOMENT, MIN_MASS
from dynx.rules.inertia.rigid_groups import rigid_groups
from dynx.rules.text.number_text import decimal

_MASS = 2.0 * MIN_MASS


def has_inertial_data(case: Case) -> bool:
    """Check that anything that can move has mass or moments; True where nothing can move."""
    moving = [case.inertials[name] for name, group in rigid_groups(case).items() if not group.static]
    return not moving or not all(map(_is_empty, moving))


def massless_links(case: Case) -> dict[str, bool]:
    """Return the first link of each moving rigid group without mass and moments.

    The value is True where no link beyond it has mass or moments either. A robot without any inertial data
    has no such links here, because DX118 reports it.
    """
    if not has_inertial_data(case):
        return {}
    model, groups = case.model, rigid_groups(case)
    empty: dict[str, bool] = {}
    for link in model.links:
        head = groups[link.name].head
        empty[head] = empty.get(head, True) and _is_empty(link.inertial)
    carrier = {
        joint.child: groups[joint.parent].head
        for joint in model.joints
        if groups[joint.child].head == joint.child
    }
    # In depth-first order each group comes after the group that carries it.
    bare = dict(empty)
    for head in reversed(carrier):
        bare[carrier[head]] = bare[carrier[head]] and bare[head]
    return {head: bare[head] for head in carrier if empty[head]}


def _is_empty(inertial: Inertial | None) -> bool:
    return inertial is None or (inertial.mass < MIN_MASS and not inertial.tensor.any())


def with_least_inertia(case: Case, names: Sequence[str]) -> tuple[Case, str]:
    """Give these links the least mass and moments that MuJoCo accepts; also return the change in words.

    A tensor that is not zero is kept.
    """
    new = {}
    for name in names:
        inertial = case.inertials[name]
        origin = IDENTITY if inertial is None else inertial.origin
        if inertial is not None and inertial.tensor.any():
            new[name] = replace(inertial, mass=_MASS)
        else:
            new[name] = Inertial(_MASS, origin, ixx=ACCEPTED_MOMENT, iyy=ACCEPTED_MOMENT, izz=ACCEPTED_MOMENT)
    many = "a link without mass" if len(new) == 1 else f"{len(new)} links without mass"
    changed = f"gave {many} {_MASS:g} kg and {ACCEPTED_MOMENT:g} kg m^2 about every axis"
    return with_inertials(case, new), changed


def least_inertial() -> str:
    """Return the text of an ``<inertial>`` with the least mass and moments that every engine accepts."""
    moments = " ".join(f'i{axis}{axis}="{decimal(ACCEPTED_MOMENT)}"' for axis in "xyz")
    products = " ".join(f'{name}="0"' for name in ("ixy", "ixz", "iyz"))
    return f'<inertial>\n  <mass value="{decimal(_MASS)}"/>\n  <inertia {moments} {products}/>\n</inertial>'


def heaviest_in_root_group(case: Case) -> str | None:
    """Return the heaviest link rigidly connected to the root, itself included; None where none has mass."""
    model = case.model
    group = rigid_groups(case)[model.root].links
    masses = {name: mass for name in group if (mass := model.inertial(name).mass) > 0.0}
    return max(masses, key=lambda name: masses[name]) if masses else None
