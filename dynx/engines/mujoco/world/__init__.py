"""Worlds in MuJoCo: a scene compiled into one MuJoCo model, stepped by MuJoCo."""
