"""Engines of worlds that the contract tests run on."""

from __future__ import annotations

WORLDS = ("pybullet", "mujoco", "drake")

FAST_WORLDS = ("pybullet", "mujoco")
"""Engines for long runs of robots on the ground; the steps of Drake take ten times as long."""
