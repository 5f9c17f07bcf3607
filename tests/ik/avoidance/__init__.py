"""Tests of `dynx.distance.avoidance` and of what uses it."""
