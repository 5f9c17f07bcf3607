"""Formats of a `DoctorReport`: an HTML page for people, and formats of CI services.

The formats are functions of reports and baselines; they run no engine. Names in a robot description may hold
anything, so each format escapes them.
"""

from dynx.doctor.formats.baseline import Baseline, baseline_document, read_baseline
from dynx.doctor.formats.html import html_page
from dynx.doctor.formats.junit import junit_xml
from dynx.doctor.formats.sarif import sarif_document
from dynx.files.annotations import github_annotations

__all__ = [
    "Baseline",
    "baseline_document",
    "github_annotations",
    "html_page",
    "junit_xml",
    "read_baseline",
    "sarif_document",
]
