"""Diagnosis of a robot's file that engines read differently: the causes, their proofs, and the mended
file."""

from dynx.doctor.diagnosis import compare_as_loaded, diagnose
from dynx.doctor.report import DoctorReport, Finding, results_document

__all__ = ["DoctorReport", "Finding", "compare_as_loaded", "diagnose", "results_document"]
