"""Formats of a `SameReport`: an HTML page for people, and formats of CI services.

They are written by the same writers as those of the doctor (`dynx.files.sarif`, `junit`, `annotations`,
`baseline`, `pages`). Names in a robot description may hold anything, so each format escapes them.
"""

from dynx.same.formats.baseline import SameBaseline, baseline_document
from dynx.same.formats.html import html_page
from dynx.same.formats.junit import junit_xml
from dynx.same.formats.sarif import sarif_document

__all__ = ["SameBaseline", "baseline_document", "html_page", "junit_xml", "sarif_document"]
