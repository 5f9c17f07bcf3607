"""A `DoctorReport` for readers other than Python: a page for people, and the formats of CI services.

Every function here is a function of reports alone; none opens a file or asks an engine. Names in a
robot description may hold anything, so each format escapes what it is given.
"""

from dynx.doctor.formats.baseline import Baseline, baseline_document, read_baseline
from dynx.doctor.formats.html import html_page
from dynx.doctor.formats.junit import junit_xml
from dynx.doctor.formats.sarif import sarif_document

__all__ = [
    "Baseline",
    "baseline_document",
    "html_page",
    "junit_xml",
    "read_baseline",
    "sarif_document",
]
