"""Compiled kernels of steps on floats: of joint friction (`dynx.steppers.implicit_joints`) and of a floating
base (`dynx.steppers.integrators`)."""

from __future__ import annotations

from functools import cache

import numpy as np

from dynx.rbd.integration import floating_step
from dynx.rbd.joint_friction import FrictionLaw, damped_equation
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.simplify import STRICT
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array


@cache
def friction_kernel(joints: tuple[int, ...], below: tuple[tuple[int, ...], ...]) -> Kernel:
    """Compile a step of the law, with `CORRECTIONS` corrections of the modes or none for a large robot;
    coefficients, step and estimated inertias are inputs.

    The first modes are the signs of the velocities plus ``shift``.
    """
    n, nv, rows = len(joints), len(below), list(joints)
    law = FrictionLaw(joints, below, (0.0,) * n)

    def step(**given: Array) -> dict[str, Array]:
        v, h, friction, single = given["v"], given["h"][0], given["friction"], given["one_by_one"][0]
        damping, armature = given["damping"], given["armature"]
        A, r = damped_equation(given["M"], given["tau"] - given["bias"], v, h, damping, armature)
        first, found, next_shift = law.step(A, r, v, friction, h, given["shift"], single, given["inertia"])
        net = given["tau"] - damping * (v + h * found.a) - armature * found.a
        net[rows] = net[rows] - found.torque
        return {
            "motion": np.array([found.a, found.moves]),
            "torque": found.torque,
            "net_torque": net,
            "next_shift": next_shift,
            "first_a": first.a,
            "unsettled": np.array([found.changes], dtype=object),
        }

    sizes: dict[str, tuple[int, ...]] = {"M": (nv, nv), "bias": (nv,), "tau": (nv,), "v": (nv,)}
    sizes |= {"shift": (n,), "one_by_one": (1,), "friction": (n,), "inertia": (n,)}
    sizes |= {"damping": (nv,), "armature": (nv,), "h": (1,)}
    program = trace(step, sizes, simplify=STRICT)
    return load_kernel(program_recipe(program), lambda: program, settings=Settings(host().lanes, fast=False))


@cache
def base_kernel() -> Kernel:
    """Compile `floating_step` of a base alone, rounded as in every other kernel that contains it."""

    def step(q: Array, v: Array, a: Array, h: Array, center: Array) -> dict[str, Array]:
        return dict(zip(("q", "v"), floating_step(q, v, a, h[0], center), strict=True))

    sizes = {"q": (7,), "v": (6,), "a": (6,), "h": (1,), "center": (3,)}
    program = trace(step, sizes, simplify=STRICT)
    return load_kernel(program_recipe(program), lambda: program, settings=Settings(host().lanes, fast=False))
