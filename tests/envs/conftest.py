"""Tests of environments need Gymnasium."""

from __future__ import annotations

import pytest

pytest.importorskip("gymnasium", reason="needs the extra envs")
