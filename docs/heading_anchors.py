"""Anchors of headings, under which pages link to sections."""

from __future__ import annotations

import re


def anchor(title: str) -> str:
    """Return the anchor of a heading, as GitHub makes it; that of a rule is its number, as in reports."""
    rule = re.match(r"DX\d{3}\b", title)
    return rule[0].lower() if rule else re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
