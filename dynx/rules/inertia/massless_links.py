"""Links that a joint moves and that have neither mass nor inertia."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dynx.model.elements import IDENTITY, Inertial
from dynx.rules.case import Case
from dynx.rules.inertia.edits import with_inertials
from dynx.rules.inertia.physical import ENOUGH, SMALLEST_MASS
from dynx.rules.inertia.rigid_groups import rigid_groups
from dynx.rules.text.number_text import decimal

_MASS = 2.0 * SMALLEST_MASS


def massless_links(case: Case) -> dict[str, bool]:
    """Links that joints carry and that have, with what is welded to them, neither mass nor tensor.

    True for those beyond which nothing has mass or a tensor either.
    """
    model, groups = case.model, rigid_groups(case)
    empty: dict[str, bool] = {}
    for link in model.links:
        head, inertial = groups[link.name].head, link.inertial
        nothing = inertial is None or (inertial.mass < SMALLEST_MASS and not inertial.tensor.any())
        empty[head] = empty.get(head, True) and nothing
    carrier = {
        joint.child: groups[joint.parent].head
        for joint in model.joints
        if groups[joint.child].head == joint.child
    }
    # Depth-first order: from the end, each group tells the one that carries it.
    bare = dict(empty)
    for head in reversed(carrier):
        bare[carrier[head]] = bare[carrier[head]] and bare[head]
    return {head: bare[head] for head in carrier if empty[head]}


def with_least_inertia(case: Case, names: Sequence[str]) -> tuple[Case, str]:
    """The case with the least mass and moments that MuJoCo takes in these links, and a word on it.

    A tensor that is not zero stays.
    """
    new = {}
    for name in names:
        inertial = case.inertials[name]
        origin = IDENTITY if inertial is None else inertial.origin
        if inertial is not None and inertial.tensor.any():
            new[name] = replace(inertial, mass=_MASS)
        else:
            new[name] = Inertial(_MASS, origin, ixx=ENOUGH, iyy=ENOUGH, izz=ENOUGH)
    many = "a link without mass" if len(new) == 1 else f"{len(new)} links without mass"
    return with_inertials(case, new), f"gave {many} {_MASS:g} kg and {ENOUGH:g} kg m^2 about every axis"


def least_inertial() -> str:
    """The text of an ``<inertial>`` with the least mass and moments that every engine takes."""
    moments = " ".join(f'i{axis}{axis}="{decimal(ENOUGH)}"' for axis in "xyz")
    products = " ".join(f'{name}="0"' for name in ("ixy", "ixz", "iyz"))
    return f'<inertial>\n  <mass value="{decimal(_MASS)}"/>\n  <inertia {moments} {products}/>\n</inertial>'


def heaviest_welded_to_root(case: Case) -> str | None:
    """The heaviest link that fixed joints weld to the root, itself included; None where none has mass."""
    model = case.model
    welded = rigid_groups(case)[model.root].links
    masses = {name: mass for name in welded if (mass := model.inertial(name).mass) > 0.0}
    return max(masses, key=lambda name: masses[name]) if masses else None
