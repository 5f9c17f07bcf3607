"""Skeleton of a robot: rigidly connected links, moving links, and which link carries which.

Independent of `dynx.rules`: planters must not use the code of the rules that they test.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Rigid groups of a model: `heads` names the first of the links rigidly connected to a link;
    `ranks` counts the independent directions about which a link rotates, in the zero position."""

    model: Model
    heads: dict[str, str]
    ranks: dict[str, int]

    @staticmethod
    def of(model: Model) -> Skeleton:
        """Make the skeleton of a model."""
        heads = {model.root: model.root}
        rotations: dict[str, Floats] = {model.root: np.eye(3)}
        axes: dict[str, list[Floats]] = {model.root: list(np.eye(3)) if model.floating else []}
        for joint in model.joints:  # depth first: a parent comes before its children
            heads[joint.child] = heads[joint.parent] if joint.type == "fixed" else joint.child
            rotation = rotations[joint.parent] @ rotation_from_rpy(np.array(joint.origin.rpy))
            rotations[joint.child] = rotation
            turning = [rotation @ np.array(joint.axis)] if joint.type in ("revolute", "continuous") else []
            axes[joint.child] = axes[joint.parent] + turning
        ranks = {
            name: int(np.linalg.matrix_rank(np.array(found), tol=1e-6)) if found else 0
            for name, found in axes.items()
        }
        return Skeleton(model, heads, ranks)

    def inertial(self, link: str) -> Inertial | None:
        """Return the inertial of the link in the file."""
        return next(each.inertial for each in self.model.links if each.name == link)

    def mass(self, link: str) -> float:
        """Return the mass of a link [kg]."""
        inertial = self.inertial(link)
        return 0.0 if inertial is None else inertial.mass

    def solid(self, link: str) -> bool:
        """Check that the link has a mass and three moments above rounding."""
        inertial = self.inertial(link)
        if inertial is None or inertial.mass < 1e-6:
            return False
        return min(inertial.ixx, inertial.iyy, inertial.izz) > 1e-9

    def size(self, link: str) -> float:
        """Return the largest moment of inertia of the link [kg m^2]."""
        inertial = self.inertial(link)
        return 0.0 if inertial is None else max(inertial.ixx, inertial.iyy, inertial.izz)

    @cached_property
    def largest_inertia(self) -> float:
        """Largest entry of the mass matrix at one pose, to which errors are relative."""
        model = self.model
        with ReferenceBackend(model) as reference:
            return float(np.max(np.abs(reference.mass_matrix(model.random(0))), initial=0.0))

    def moves(self, link: str) -> bool:
        """Check that some joint moves the link."""
        return self.model.floating or self.heads[link] != self.model.root

    def rigid_group(self, link: str) -> list[str]:
        """List the links rigidly connected to the link, itself included."""
        return [each for each, head in self.heads.items() if head == self.heads[link]]

    def carried(self, link: str) -> list[str]:
        """List the children of the link, on moving and fixed joints."""
        return [joint.child for joint in self.model.joints if joint.parent == link]

    def is_single_body(self, link: str) -> bool:
        """Check that the link has a parent joint, and nothing rigidly connected to it has mass."""
        carried = self.heads[link] == link and link != self.model.root
        return carried and all(self.mass(each) < 1e-6 for each in self.rigid_group(link) if each != link)

    def groups_beyond(self, link: str) -> list[str]:
        """List the heads of all rigid groups beyond that of the link."""
        group = set(self.rigid_group(link))
        found: list[str] = []
        for joint in self.model.joints:
            if joint.parent in group and joint.child not in group:
                found.append(joint.child)
                group.add(joint.child)
                group.update(self.rigid_group(joint.child))
        return found
