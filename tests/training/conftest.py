"""Tests of training need stable-baselines3."""

from __future__ import annotations

import pytest

pytest.importorskip("stable_baselines3", reason="needs the extra train")
