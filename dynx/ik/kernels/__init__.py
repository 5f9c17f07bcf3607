"""Inverse kinematics in compiled kernels: the step of the solver traced for one frame of one robot."""
