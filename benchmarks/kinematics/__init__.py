"""Benchmarks of kinematics beyond one pose at a time."""
