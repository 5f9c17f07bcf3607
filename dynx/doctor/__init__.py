"""Diagnosis of a robot's file that engines read differently: the causes, their proofs, and the mended
file."""

from typing import TYPE_CHECKING

from dynx.doctor.diagnosis import compare_as_loaded, diagnose
from dynx.doctor.report import DoctorReport, Finding, results_document
from dynx.registry import moved_names

__all__ = ["DoctorReport", "Finding", "compare_as_loaded", "diagnose", "results_document"]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {})
