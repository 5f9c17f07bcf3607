"""Engines of worlds that the contract tests run on."""

from __future__ import annotations

WORLDS = ("pybullet", "mujoco", "drake")
