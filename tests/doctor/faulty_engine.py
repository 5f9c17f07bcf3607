"""Engine with known faults, made of the reference backend, so that the correct diagnosis is known."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from dynx.doctor.examination import Examination, Examiner, model_without_mimics
from dynx.errors import EngineError
from dynx.loaded import LoadedModel, LoadedRobot
from dynx.model import Inertial, Model
from dynx.model.document_format import Format
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.rules import Case
from dynx.spatial.scalar import Floats

NAME = "pybullet"
"""Name of an engine in the rules."""

SECRET = "secret"
"""Word in a file that the engine refuses."""

HEAVY = Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0)
"""Inertial of a link without ``<inertial>``, as in PyBullet (DX101)."""


class FaultyEngine(LoadedRobot):
    """Correct except for links without ``<inertial>``; subclasses have more faults."""

    name: ClassVar[str] = NAME
    CALLS: ClassVar[Mapping[str, str]] = {}

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        text = path.read_bytes()
        if SECRET.encode() in text:
            raise EngineError(f"{path.name} is a {SECRET}")
        read = model_without_mimics(XmlSource(text), model.base)
        links = tuple(replace(link, inertial=link.inertial or HEAVY) for link in read.links)
        self.model, self.right = model, ReferenceBackend(replace(read, links=links))

    @classmethod
    def engine_version(cls) -> str:
        """Return a version for which the rules hold."""
        return "3.2.7"

    @classmethod
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return a placeholder."""
        return "load(path)"

    def describe(self) -> LoadedModel:
        """Return an empty description."""
        return LoadedModel(NAME, {}, {}, np.eye(4), np.array([0.0, 0.0, -9.80665]))

    def link_poses(self, q: Floats) -> Floats:
        """Return the value of the reference backend."""
        return self.right.forward_kinematics(q)[: len(self.model.links)]

    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the value of the reference backend."""
        return self.right.jacobian(q, link)

    def mass_matrix(self, q: Floats) -> Floats:
        """Return the value of the reference backend."""
        return self.right.mass_matrix(q)

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the value of the reference backend."""
        return self.right.inverse_dynamics(q, v, a)

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the value of the reference backend."""
        return self.right.forward_dynamics(q, v, tau)

    def close(self) -> None:
        """Close the reference."""
        self.right.close()


def examiner(engine: type[LoadedRobot] = FaultyEngine, samples: int = 3) -> Examiner:
    """Make an examiner of that engine alone."""
    made = Examiner((), samples, 0)
    made.engines[NAME] = engine
    return made


def examine_case(case: Case, engine: type[LoadedRobot] = FaultyEngine, samples: int = 3) -> Examination:
    """Examine a case with that engine."""
    return examiner(engine, samples).examine(case)
