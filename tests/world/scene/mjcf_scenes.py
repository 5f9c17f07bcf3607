"""Random scenes in MJCF, and a scene of dynx beside MuJoCo's own model of its file."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st

import dynx
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat
from dynx.world import Scene, SceneRobot
from tests.model.mjcf.models import bodies, geoms, poses
from tests.model.random_numbers import numbers, vector

Draw = Callable[[st.SearchStrategy[Any]], Any]


@st.composite
def scenes(draw: Draw) -> str:
    """A model in MJCF that MuJoCo compiles: trees that move freely, fixed ones, and static bodies."""
    counts: dict[str, int] = {}

    def names(kind: str) -> str:
        counts[kind] = counts.get(kind, 0) + 1
        return f"{kind}{counts[kind]}"

    def single(free: bool) -> str:
        joint = draw(st.sampled_from(["<freejoint/>", '<joint type="free"/>'])) if free else ""
        inside = "".join(draw(geoms()) for _ in range(draw(st.integers(1, 3))))
        return f'<body name="{names("b")}"{draw(poses())}>{joint}{inside}</body>'

    parts = [draw(bodies(names, 1, free=True, with_balls=False)) for _ in range(draw(st.integers(0, 2)))]
    parts += [draw(bodies(names, 1, with_balls=False)) for _ in range(draw(st.integers(0, 2)))]
    parts += [single(free=True) for _ in range(draw(st.integers(1, 3)))]
    parts += [single(free=False) for _ in range(draw(st.integers(0, 1)))]
    parts.append('<geom type="plane" size="1 1 1"/>')
    order = draw(st.permutations(range(len(parts))))
    compiler = draw(st.sampled_from(["", ' angle="radian"', ' eulerseq="zyx"', ' settotalmass="7"']))
    return f"""<mujoco model="random scene">
  <compiler{compiler}/>
  <option gravity="{draw(vector(3, numbers))}"/>
  <default>
    <geom density="500"/>
    <default class="dense"><geom density="2000" euler="10 20 30"/><joint damping="0.5"/>
      <default class="tilted"><geom quat="1 1 0 0"/></default>
    </default>
  </default>
  <worldbody>{"".join(parts[k] for k in order)}</worldbody>
</mujoco>"""


def differences(mujoco: Any, compiled: Any, scene: Scene, seed: int = 0) -> dict[str, float]:
    """Return the largest differences of a scene from MuJoCo's model of its file, by what differs.

    Poses are those of the start [m]; masses, mass matrices and inverse dynamics are relative to their largest
    entry, at a random state. Links and bodies are compared by name.
    """
    data = mujoco.MjData(compiled)
    mujoco.mj_kinematics(compiled, data)
    ids = {compiled.body(k).name or f"body_{k}": k for k in range(1, compiled.nbody)}
    ids |= {
        name.strip("/").replace("/", "_"): k for name, k in ids.items() if name.replace("/", "_") not in ids
    }
    enabled = not compiled.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    found = {"gravity": float(np.abs(np.array(scene.gravity) - enabled * compiled.opt.gravity).max())}
    found["poses"] = found["masses"] = found["matrices"] = found["torques"] = 0.0

    def take(what: str, got: Floats, want: Floats, scale: float | None = None) -> None:
        size = max(float(np.abs(want).max(initial=0.0)), 1e-9) if scale is None else scale
        found[what] = max(found[what], float(np.abs(got - want).max(initial=0.0)) / size)

    coordinates = 0
    for body in scene.bodies:
        number = ids.get(body.name)
        if not body.fixed:
            coordinates += 6
            assert number is not None
            take("masses", np.array(body.mass), compiled.body_mass[number])
            center = body.pose.matrix[:3, :3] @ np.array(body.center_of_mass) + body.pose.xyz
            R = body.pose.matrix[:3, :3]
            mujoco.mj_comPos(compiled, data)
            take("poses", center, data.xipos[number], 1.0)
            axes = data.ximat[number].reshape(3, 3)
            want = axes @ np.diag(compiled.body_inertia[number]) @ axes.T
            take("masses", R @ np.array(body.inertia) @ R.T, want)
        # A geom of the world may have the name of a body without geoms.
        if number is not None and compiled.body_geomnum[number]:
            take("poses", body.pose.matrix, _pose(data, number), 1.0)
    for robot in scene.robots:
        coordinates += robot.model.nv + sum(joint.mimic is not None for joint in robot.model.joints)
        _compare_robot(mujoco, compiled, data, robot, ids, take, seed)
    found["coordinates"] = float(abs(coordinates - compiled.nv))
    return found


def _compare_robot(
    mujoco: Any,
    compiled: Any,
    start: Any,
    robot: SceneRobot,
    ids: dict[str, int],
    take: Callable[..., None],
    seed: int,
) -> None:
    model = robot.model
    engine = dynx.backend("reference", model)
    own = [ids[link.name] for link in model.links if link.name in ids]
    at = dict(zip(model.frame_names, engine.forward_kinematics(np.array(robot.q)), strict=True))
    for link in model.links:
        if link.name in ids:
            take("poses", at[link.name], _pose(start, ids[link.name]), 1.0)
    dofs = [k for k in range(compiled.nv) if compiled.dof_bodyid[k] in own]
    if len(dofs) != model.nv:
        return
    random, data = np.random.default_rng(seed), mujoco.MjData(compiled)
    joints = sorted({int(compiled.dof_jntid[k]) for k in dofs})
    shift = 7 if model.floating else 0
    q = np.array(robot.q)
    if model.floating:
        q[:3] = random.normal(size=3)
        q[3:7] = (quat := random.normal(size=4)) / np.linalg.norm(quat)
    q[shift:] += random.uniform(-1.0, 1.0, model.nq - shift)
    for place in model.ball_places:
        q[place : place + 4] /= np.linalg.norm(q[place : place + 4])
    v, a = random.normal(size=(2, model.nv))
    R = rotation_from_quat(q[3:7]) if model.floating else np.eye(3)
    turned = np.eye(model.nv)
    if model.floating:
        turned[:3, :3] = R
        first = compiled.jnt_qposadr[joints[0]]
        data.qpos[first : first + 7] = q[[0, 1, 2, 6, 3, 4, 5]]
    place = shift
    for joint in joints[1 if model.floating else 0 :]:
        address = compiled.jnt_qposadr[joint]
        if compiled.jnt_type[joint] == mujoco.mjtJoint.mjJNT_BALL:
            data.qpos[address : address + 4] = q[[place + 3, place, place + 1, place + 2]]
            place += 4
        else:
            data.qpos[address] = q[place]
            place += 1
    assert place == model.nq
    data.qvel[dofs] = turned @ v
    data.qacc[dofs] = turned @ (a + _transport(v, model.floating))
    for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_crb, mujoco.mj_comVel):
        step(compiled, data)
    M, tau = np.zeros((compiled.nv, compiled.nv)), np.zeros(compiled.nv)
    mujoco.mj_fullM(compiled, data, M)
    mujoco.mj_rne(compiled, data, 1, tau)
    M = (M - np.diag(compiled.dof_armature))[np.ix_(dofs, dofs)]
    take("matrices", engine.mass_matrix(q), turned.T @ M @ turned)
    take("torques", engine.inverse_dynamics(q, v, a), turned.T @ tau[dofs])


def _transport(v: Floats, floating: bool) -> Floats:
    """Return what the acceleration in world axes has more than that in the axes of the base, turned back."""
    more = np.zeros(len(v))
    if floating:
        more[:3] = np.cross(v[3:6], v[:3])
    return more


def _pose(data: Any, number: int) -> Floats:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = data.xmat[number].reshape(3, 3), data.xpos[number]
    return T
