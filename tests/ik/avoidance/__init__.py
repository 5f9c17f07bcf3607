"""Tests of `dynx.ik.avoidance` and of what uses it."""
