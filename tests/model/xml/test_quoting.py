"""Attribute values: quoted as the standard library quotes them."""

from __future__ import annotations

import subprocess
import sys
from xml.sax.saxutils import quoteattr as expected

from hypothesis import given
from hypothesis import strategies as st

from dynx.model.xml.text import quoteattr


@given(st.text(alphabet=st.one_of(st.sampled_from("&<>\"'\n\r\t;#"), st.characters())))
def test_values_are_quoted_as_by_the_standard_library(text: str) -> None:
    assert quoteattr(text) == expected(text)


def test_models_are_imported_without_an_http_client() -> None:
    code = "import sys, dynx.model; print('http.client' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"
