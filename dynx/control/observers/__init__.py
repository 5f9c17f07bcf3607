"""Estimates of what acts on a robot, beside its controllers."""
