"""Why engines differ on a robot's file: the causes, the proof of each, and the file mended."""

from dynx.doctor.diagnosis import compare_as_loaded, diagnose
from dynx.doctor.report import DoctorReport, Finding, results_document

__all__ = ["DoctorReport", "Finding", "compare_as_loaded", "diagnose", "results_document"]
