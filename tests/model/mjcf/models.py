"""Random models in MJCF, written from the format's reference, and what MuJoCo makes of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

from dynx.spatial.scalar import Floats
from tests.model.random_numbers import Draw, direction, lengths, numbers, vector


def angles(count: int) -> st.SearchStrategy[str]:
    return vector(count, st.floats(-100.0, 100.0).map(lambda x: round(x, 2)))


@st.composite
def orientations(draw: Draw) -> str:
    """An attribute that states an orientation, or nothing."""
    kind = draw(st.sampled_from(["", "quat", "euler", "axisangle", "zaxis", "xyaxes"]))
    if kind == "quat":
        return f' quat="{draw(direction(4))}"'
    if kind == "euler":
        return f' euler="{draw(angles(3))}"'
    if kind == "axisangle":
        return f' axisangle="{draw(direction())} {draw(angles(1))}"'
    if kind == "zaxis":
        return f' zaxis="{draw(direction())}"'
    if kind == "xyaxes":
        x = draw(direction())
        y = draw(direction().filter(lambda y: np.linalg.norm(np.cross(_array(x), _array(y))) > 0.1))
        return f' xyaxes="{x} {y}"'
    return ""


def _array(text: str) -> Floats:
    return np.array(text.split(), float)


@st.composite
def poses(draw: Draw) -> str:
    position = draw(st.sampled_from(["", "pos"]))
    orientation: str = draw(orientations())
    return (f' pos="{draw(vector(3))}"' if position else "") + orientation


@st.composite
def geoms(draw: Draw) -> str:
    kind = draw(st.sampled_from(["sphere", "box", "capsule", "cylinder", "ellipsoid"]))
    sizes = {"sphere": 1, "box": 3, "capsule": 2, "cylinder": 2, "ellipsoid": 3}[kind]
    mass = draw(st.sampled_from(["", ' mass="0.7"', ' density="350"', ' mass="0.2" density="7"']))
    chosen = draw(st.sampled_from(["", ' class="dense"', ' class="tilted"']))
    group = draw(st.sampled_from(["", "", ' group="3"']))
    if kind != "sphere" and draw(st.booleans()):
        ends = draw(vector(6).filter(lambda e: np.linalg.norm(_array(e)[:3] - _array(e)[3:]) > 0.1))
        placed = f' size="{draw(lengths)}" fromto="{ends}"'
    else:
        placed = f' size="{draw(vector(sizes, lengths))}"' + draw(poses())
    # MuJoCo loses digits of the shell of an ellipsoid, which has a test of its own.
    hollow = [' shellinertia="true"'] if kind != "ellipsoid" else []
    shell = draw(st.sampled_from(["", "", *hollow]))
    return f'<geom type="{kind}"{placed}{mass}{chosen}{group}{shell}/>'


@st.composite
def joints(draw: Draw, names: Callable[[str], str]) -> str:
    kind = draw(st.sampled_from(["hinge", "slide"]))
    text = f'<joint name="{names("j")}" type="{kind}" axis="{draw(direction())}"'
    if draw(st.booleans()):
        text += f' pos="{draw(vector(3))}"'
    if draw(st.booleans()):
        text += ' range="-0.5 0.75"'
    if draw(st.booleans()):
        text += f' ref="{draw(numbers)}"'
    if draw(st.booleans()):
        text += ' damping="0.3" frictionloss="0.1" armature="0.02" actuatorfrcrange="-7 7"'
    return text + "/>"


@st.composite
def ball_joints(draw: Draw, names: Callable[[str], str]) -> str:
    unused = draw(st.sampled_from(["", ' axis="0 0 0"', ' ref="2"']))
    text = f'<joint name="{names("j")}" type="ball"{unused}'
    if draw(st.booleans()):
        text += f' pos="{draw(vector(3))}"'
    if draw(st.booleans()):
        text += ' range="0 0.75"'
    if draw(st.booleans()):
        text += ' damping="0.3" frictionloss="0.1" armature="0.02" stiffness="3"'
    return text + "/>"


@st.composite
def bodies(
    draw: Draw,
    names: Callable[[str], str],
    depth: int = 3,
    *,
    free: bool = False,
    balanced: bool = False,
    with_balls: bool = True,
) -> str:
    parts = ["<freejoint/>"] if free else [draw(joints(names)) for _ in range(draw(st.integers(0, 3)))]
    balls = [draw(ball_joints(names))] if with_balls and not free and draw(st.integers(0, 3)) == 0 else []
    parts += [draw(geoms()) for _ in range(draw(st.integers(1, 2)))]
    if draw(st.booleans()):
        inertial = '<inertial pos="0.1 0 -0.2" mass="1.5" '
        stated = ['diaginertia="0.3 0.2 0.4"', 'fullinertia="0.3 0.4 0.5 0.01 -0.02 0.03"']
        # The largest exceeds the sum of the others, which MuJoCo refuses unless it may balance them.
        impossible = ['diaginertia="0.1 0.2 0.4"', 'fullinertia="0.8 0.1 0.2 0.01 -0.02 0.03"']
        moments = draw(st.sampled_from(stated + impossible if balanced else stated))
        turned = draw(orientations()) if "diag" in moments else ""
        parts.append(f"{inertial}{moments}{turned}/>")
    parts.append(f'<site name="{names("s")}"{draw(poses())}/>')
    for _ in range(draw(st.integers(0, 2 if depth else 0))):
        below = draw(bodies(names, depth - 1, balanced=balanced, with_balls=with_balls))
        parts.append(draw(st.sampled_from([below, f"<frame{draw(poses())}>{below}</frame>"])))
    wrapped = draw(st.sampled_from(["", "childclass"]))
    childclass = ' childclass="dense"' if wrapped else ""
    order = draw(st.permutations(range(len(parts))))
    # No joint that turns the body may follow a ball joint.
    contents = "".join([*(parts[k] for k in order), *balls])
    return f'<body name="{names("b")}"{draw(poses())}{childclass}>{contents}</body>'


@st.composite
def models(draw: Draw) -> str:
    """A model in MJCF that MuJoCo compiles."""
    counts: dict[str, int] = {}

    def names(kind: str) -> str:
        counts[kind] = counts.get(kind, 0) + 1
        return f"{kind}{counts[kind]}"

    compiler = ""
    if draw(st.booleans()):
        compiler += ' angle="radian"'
    if draw(st.booleans()):
        compiler += f' eulerseq="{draw(st.sampled_from(["zyx", "XYZ", "xYz", "zxz"]))}"'
    if draw(st.booleans()):
        compiler += ' inertiafromgeom="true"'
    if draw(st.booleans()):
        compiler += f' boundmass="0.5" boundinertia="{draw(st.sampled_from([0.01, 0.25]))}"'
    balanced = draw(st.booleans())
    if balanced:
        compiler += ' balanceinertia="true"'
    if draw(st.booleans()):
        compiler += ' inertiagrouprange="0 3"'
    free = draw(st.booleans())
    trees = [
        draw(bodies(names, free=free, balanced=balanced))
        for _ in range(1 if free else draw(st.integers(1, 2)))
    ]
    copies = "" if free else f'<replicate count="3" offset="{draw(vector(3))}" euler="{draw(angles(3))}">'
    copied = f"{copies}{draw(bodies(names, 0))}</replicate>" if copies else ""
    return f"""<mujoco model="random">
  <compiler{compiler}/>
  <option gravity="0.3 -0.7 -9.81"/>
  <default>
    <geom density="500"/>
    <joint axis="0 1 0" armature="0.001"/>
    <default class="dense"><geom density="2000" euler="10 20 30"/><joint damping="0.5"/>
      <default class="tilted"><geom quat="1 1 0 0"/></default>
    </default>
  </default>
  <worldbody><geom type="plane" size="1 1 1"/>{"".join(trees)}{copied}</worldbody>
</mujoco>"""


@dataclass(frozen=True)
class Results:
    """Mass matrix and inverse dynamics by MuJoCo without armature, in dynx's coordinates; poses by name."""

    q: Floats
    v: Floats
    a: Floats
    mass_matrix: Floats
    torques: Floats
    bodies: dict[str, Floats]
    sites: dict[str, Floats]


def compute(mujoco: Any, compiled: Any, seed: int, *, free: bool) -> Results:
    """Compute at a random state by MuJoCo."""
    random, data = np.random.default_rng(seed), mujoco.MjData(compiled)
    q = np.array(compiled.qpos0) + random.uniform(-1.0, 1.0, compiled.nq)
    quaternions = [3] * free + [
        int(compiled.jnt_qposadr[k])
        for k in range(compiled.njnt)
        if compiled.jnt_type[k] == mujoco.mjtJoint.mjJNT_BALL
    ]
    for first in quaternions:
        q[first : first + 4] /= np.linalg.norm(q[first : first + 4])
    v, a = random.normal(size=(2, compiled.nv))
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_crb, mujoco.mj_comVel):
        step(compiled, data)
    M = np.zeros((compiled.nv, compiled.nv))
    mujoco.mj_fullM(compiled, data, M)
    M -= np.diag(compiled.dof_armature)
    tau = np.zeros(compiled.nv)
    mujoco.mj_rne(compiled, data, 1, tau)
    if free:
        # MuJoCo's linear velocity of a free joint is in world axes, dynx's in those of the base.
        R = data.xmat[compiled.jnt_bodyid[0]].reshape(3, 3)
        turned = np.eye(compiled.nv)
        turned[:3, :3] = R.T
        v[:3] = R.T @ v[:3]
        a[:3] = R.T @ a[:3] - np.cross(v[3:6], v[:3])
        M, tau = turned @ M @ turned.T, turned @ tau
    for first in quaternions:
        q[first : first + 4] = q[[first + 1, first + 2, first + 3, first]]
    return Results(
        q,
        v,
        a,
        M,
        tau,
        {compiled.body(k).name: _pose(data.xmat[k], data.xpos[k]) for k in range(1, compiled.nbody)},
        {compiled.site(k).name: _pose(data.site_xmat[k], data.site_xpos[k]) for k in range(compiled.nsite)},
    )


def _pose(R: Floats, p: Floats) -> Floats:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R.reshape(3, 3), p
    return T
