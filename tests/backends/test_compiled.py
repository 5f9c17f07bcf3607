"""The compiled backend: what it adds to the contract, and where its answers come from."""

from __future__ import annotations

import os
import pickle
import threading
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.backends import backend, compiled_kernels
from dynx.backends.compiled import CompiledBackend
from dynx.backends.compiled_call import FEW, KernelCall, NumericCall
from dynx.backends.compiled_kernels import QUANTITIES, _fingerprint, compiles, is_physical, tidied
from dynx.backends.derived import HOOK_OF_QUANTITY, native_quantities
from dynx.errors import (
    ArgumentError,
    ClosedError,
    DTypeError,
    NotFiniteError,
    ShapeError,
    SingularMassMatrixError,
)
from dynx.model import Inertial, Joint, Link, Mechanism, Model, Pose
from dynx.model.configuration import TOO_LARGE
from dynx.model.mechanism import build_mechanism
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Floats
from tests.backends.robots import chain, mixed_robot
from tests.closeness import Closeness, samples_at

ROBOTS = {
    "fixed": mixed_robot(),
    "floating": mixed_robot("floating"),
    "mimic": mixed_robot(mimic=True),
    "floating mimic": mixed_robot("floating", mimic=True),
}
TIP = "tip"


def made(model: Model, **options: Any) -> CompiledBackend:
    engine = backend("compiled", model, **options)
    assert isinstance(engine, CompiledBackend)
    return engine


@pytest.fixture(scope="module", params=ROBOTS)
def engine(request: pytest.FixtureRequest) -> CompiledBackend:
    return made(ROBOTS[request.param])


def state(model: Model, size: tuple[int, ...] = ()) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(3)
    q = model.random(rng, size)
    v, a = rng.standard_normal((2, *size, model.nv))
    return q, v, a


Ask = Callable[..., Floats]

WITH_OUT: dict[str, tuple[Ask, Callable[[Model], tuple[int, ...]]]] = {
    "inverse_dynamics": (lambda e, q, v, a, **o: e.inverse_dynamics(q, v, a, **o), lambda m: (m.nv,)),
    "joint dynamics": (
        lambda e, q, v, a, **o: e.inverse_dynamics(q, v, a, joint_dynamics=True, **o),
        lambda m: (m.nv,),
    ),
    "forward_dynamics": (lambda e, q, v, a, **o: e.forward_dynamics(q, v, a, **o), lambda m: (m.nv,)),
    "pushed": (
        lambda e, q, v, a, **o: e.forward_dynamics(q, v, a, external_forces={TIP: np.ones(6)}, **o),
        lambda m: (m.nv,),
    ),
    "mass_matrix": (lambda e, q, v, a, **o: e.mass_matrix(q, **o), lambda m: (m.nv, m.nv)),
    "with rotors": (
        lambda e, q, v, a, **o: e.mass_matrix(q, joint_dynamics=True, **o),
        lambda m: (m.nv, m.nv),
    ),
    "jacobian": (lambda e, q, v, a, **o: e.jacobian(q, TIP, reference="local", **o), lambda m: (6, m.nv)),
    "jacobian at a point": (
        lambda e, q, v, a, **o: e.jacobian(q, TIP, point=(0.1, 0.2, 0.3), **o),
        lambda m: (6, m.nv),
    ),
    "placement": (lambda e, q, v, a, **o: e.forward_kinematics(q, TIP, **o), lambda m: (4, 4)),
    "placements": (
        lambda e, q, v, a, **o: e.forward_kinematics(q, **o),
        lambda m: (len(m.frame_names), 4, 4),
    ),
    "two placements": (
        lambda e, q, v, a, **o: e.forward_kinematics(q, [TIP, "link2"], **o),
        lambda m: (2, 4, 4),
    ),
}


@pytest.mark.parametrize("size", [(), (0,), (1,), (2, 3), (FEW + 5,)])
@pytest.mark.parametrize(("ask", "tail"), WITH_OUT.values(), ids=WITH_OUT)
def test_out(
    engine: CompiledBackend, ask: Ask, tail: Callable[[Model], tuple[int, ...]], size: tuple[int, ...]
) -> None:
    given = state(engine.model, size)
    wanted = ask(engine, *given)
    out = np.full((*size, *tail(engine.model)), np.nan)
    assert ask(engine, *given, out=out) is out
    np.testing.assert_array_equal(out, wanted)


@pytest.mark.parametrize("size", [(), (3,), (FEW + 5,)])
@pytest.mark.parametrize(("ask", "tail"), WITH_OUT.values(), ids=WITH_OUT)
def test_out_that_does_not_fit(
    engine: CompiledBackend, ask: Ask, tail: Callable[[Model], tuple[int, ...]], size: tuple[int, ...]
) -> None:
    given = state(engine.model, size)
    shape = (*size, *tail(engine.model))
    locked = np.empty(shape)
    locked.flags.writeable = False
    for out, error in [
        (np.empty((*shape, 1)), ShapeError),
        (np.empty((2, *shape)), ShapeError),
        (np.empty(shape, dtype=np.float32), DTypeError),
        (np.empty(shape).tolist(), ArgumentError),
        (locked, ArgumentError),
        (np.empty((*shape[:-1], 2 * shape[-1]))[..., ::2], ArgumentError),
    ]:
        with pytest.raises(error, match="out"):
            ask(engine, *given, out=out)


@pytest.mark.parametrize("size", [(), (3,), (FEW + 5,)])
def test_out_over_an_argument(engine: CompiledBackend, size: tuple[int, ...]) -> None:
    """Also where the first look at the arguments finds a quaternion to be scaled."""
    q, v, a = state(engine.model, size)
    if engine.model.floating:
        q[..., 3:7] *= 1.0 + 1e-9
    wanted = engine.inverse_dynamics(q, v, a)
    np.testing.assert_array_equal(engine.inverse_dynamics(q, v, a, out=v), wanted)
    assert engine.inverse_dynamics(q, v, a, out=v) is v


# -- small batches, large batches, single samples ----------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3, 8, FEW - 1, FEW, FEW + 1, 3 * FEW])
def test_every_way_gives_the_same_bits(engine: CompiledBackend, n: int) -> None:
    """One at a time, in the workspace, where the arrays lie, with strides, spread, by threads."""
    q, v, a = state(engine.model, (n,))
    whole = engine.inverse_dynamics(q, v, a)
    for k in range(n):
        np.testing.assert_array_equal(engine.inverse_dynamics(q[k], v[k], a[k]), whole[k])
    doubled = [np.repeat(x, 2, axis=0)[::2] for x in (q, v, a)]
    np.testing.assert_array_equal(engine.inverse_dynamics(*doubled), whole)
    turned = [np.asfortranarray(x) for x in (q, v, a)]
    np.testing.assert_array_equal(engine.inverse_dynamics(*turned), whole)
    np.testing.assert_array_equal(engine.inverse_dynamics(q[:, None], v[:, None], a[:, None])[:, 0], whole)
    spread = engine.inverse_dynamics(q, v[0], a[0])
    np.testing.assert_array_equal(spread[0], whole[0])
    np.testing.assert_array_equal(spread, engine.inverse_dynamics(q, np.tile(v[0], (n, 1)), a[:1]))


def test_threads_change_nothing() -> None:
    model = ROBOTS["floating"]
    q, v, a = state(model, (20_000,))
    answers = [made(model, threads=threads).inverse_dynamics(q, v, a) for threads in (1, 2, 5, None)]
    for answer in answers[1:]:
        np.testing.assert_array_equal(answer, answers[0])


@pytest.mark.parametrize("threads", [0, -1, 2.0, "2", True])
def test_odd_numbers_of_threads(threads: object) -> None:
    with pytest.raises(ArgumentError, match="threads is"):
        backend("compiled", chain(1), threads=threads)


def test_pickling_keeps_the_threads() -> None:
    assert pickle.loads(pickle.dumps(made(chain(1), threads=3)))._threads == 3


def test_a_kernel_is_made_once_however_many_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    model = chain(3)
    engine = made(model)
    asked: list[str] = []
    make = compiled_kernels.quantity_kernel

    def counted(mechanism: Mechanism, name: str, details: tuple[Any, ...], *, tree: bool) -> Kernel:
        asked.append(name)
        return make(mechanism, name, details, tree=tree)

    monkeypatch.setattr("dynx.backends.compiled.quantity_kernel", counted)
    q, v, a = state(model)
    start = threading.Barrier(6)

    def ask() -> None:
        start.wait()
        engine.inverse_dynamics(q, v, a)

    threads = [threading.Thread(target=ask) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert asked == ["inverse_dynamics"]


def test_closing_while_others_ask() -> None:
    """They get the right answer or ClosedError, and nothing is freed beneath them."""
    model = ROBOTS["fixed"]
    q, v, a = state(model, (5000,))
    wanted = made(model).inverse_dynamics(q, v, a)
    for _ in range(5):
        engine = made(model)
        wrong: list[object] = []

        def ask(engine: CompiledBackend = engine, wrong: list[object] = wrong) -> None:
            try:
                while True:
                    if not np.array_equal(engine.inverse_dynamics(q, v, a), wanted):
                        wrong.append("answer")
            except ClosedError:
                return

        threads = [threading.Thread(target=ask) for _ in range(3)]
        for thread in threads:
            thread.start()
        engine.close()
        for thread in threads:
            thread.join(30)
        assert not wrong


# -- what is refused --------------------------------------------------------------------------------


@pytest.mark.parametrize("n", [None, 1, 9, FEW + 9])
@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, TOO_LARGE, -2 * TOO_LARGE, 1e300])
def test_a_bad_number_anywhere(engine: CompiledBackend, n: int | None, which: int, value: float) -> None:
    given = state(engine.model, () if n is None else (n,))
    given[which].reshape(-1)[-1] = value
    error = ArgumentError if np.isfinite(value) else NotFiniteError
    with pytest.raises(error, match=f"{'qva'[which]}\\["):
        engine.inverse_dynamics(*given)


def test_large_numbers_that_are_allowed() -> None:
    """The sum of their squares passes the bound on one number, but not that on its square."""
    model = chain(2)
    engine = made(model)
    v = np.full((3, 2), 0.9 * TOO_LARGE)
    for rows in (v, v[0], np.tile(v, (FEW, 1))):
        tau = engine.inverse_dynamics(0 * rows, 0 * rows, rows)
        assert np.isfinite(tau).all()


@pytest.mark.parametrize("robot", ["floating", "floating mimic"])
def test_quaternions_are_scaled_or_refused(robot: str) -> None:
    engine = made(ROBOTS[robot])
    for size in ((), (3,), (FEW + 3,)):
        q, v, a = state(engine.model, size)
        wanted = engine.inverse_dynamics(q, v, a)
        off = q.copy()
        off[..., 3:7] *= 1.0 + 1e-8
        rows = [x.reshape(-1, x.shape[-1]) for x in (q, v, a)]
        close = Closeness(samples_at(engine.model, rows[0], rows[1], rows[2]))
        close.check(
            "inverse_dynamics",
            engine.inverse_dynamics(off, v, a).reshape(-1, engine.model.nv),
            wanted.reshape(-1, engine.model.nv),
        )
        off[..., 3:7] *= 1.1
        with pytest.raises(ArgumentError, match="quaternion"):
            engine.inverse_dynamics(off, v, a)


def test_without_validation_nothing_is_refused() -> None:
    model = chain(2)
    engine = made(model, validate=False)
    for size in ((), (3,), (FEW + 3,)):
        q, v, a = state(model, size)
        v[..., 0] = np.nan
        assert np.isnan(engine.inverse_dynamics(q, v, a)[..., 0]).all()
    # Shapes are looked at all the same: nothing outside the arrays is read.
    with pytest.raises(ShapeError):
        engine.inverse_dynamics(np.zeros((9, 3)), np.zeros((9, 2)), np.zeros((9, 2)))


def test_a_configuration_without_an_acceleration() -> None:
    """Two prismatic joints that become parallel: singular at one angle of the hinge between them."""
    body = Inertial(1.0, Pose(), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1)
    joints = [
        Joint("first", "prismatic", "ground", "a", axis=(1.0, 0.0, 0.0)),
        Joint("hinge", "continuous", "a", "b", axis=(0.0, 0.0, 1.0)),
        Joint("second", "prismatic", "b", "c", axis=(1.0, 0.0, 0.0)),
    ]
    links = [
        Link("ground"),
        Link("a"),
        Link("b", replace(body, mass=0.0)),
        Link("c", replace(body, mass=1.0)),
    ]
    model = Model.build("slides", links, joints)
    engine, ask = made(model), np.zeros(3)
    for q in (np.zeros(3), np.zeros((4, 3)), np.zeros((FEW + 4, 3))):
        with pytest.raises(SingularMassMatrixError, match="at this configuration"):
            engine.forward_dynamics(q, ask, ask)
    assert np.isfinite(engine.forward_dynamics(np.array([0.0, 1.0, 0.0]), ask, ask)).all()


def test_a_batch_that_does_not_fit_into_memory() -> None:
    model = chain(2)
    q = np.broadcast_to(np.zeros(2), (10**14, 2))
    with pytest.raises(MemoryError):
        made(model).mass_matrix(q)


# -- where the answers come from ---------------------------------------------------------------------


def test_every_quantity_is_native() -> None:
    assert native_quantities(CompiledBackend) >= set(QUANTITIES) - {"frame_placement", "frame_placements"}


def test_mimic_joints_are_part_of_the_kernel() -> None:
    """A call in model coordinates makes one kernel, whose inputs are those coordinates."""
    engine = made(ROBOTS["mimic"])
    q, v, a = state(engine.model)
    engine.inverse_dynamics(q, v, a)
    engine.bias_torque(q, v)
    engine.forward_dynamics(q, v, a)
    for call in engine._calls.values():
        assert isinstance(call, KernelCall)
        assert {port.shape for port in call._kernel.inputs} == {(engine.model.nv,)}


def test_hooks_answer_in_tree_coordinates() -> None:
    engine = made(ROBOTS["mimic"])
    coupling = engine._mechanism.coupling
    assert coupling is not None
    q, v, a = state(engine.model, (3,))
    S = coupling.matrix()
    tree = engine._inverse_dynamics(coupling.expand_q(q), v @ S.T, a @ S.T)
    Closeness(samples_at(engine.model, q, v, a)).check(
        "inverse_dynamics", tree @ S, engine.inverse_dynamics(q, v, a)
    )


def test_an_unphysical_robot_with_mimic_joints_is_solved_with_pivots() -> None:
    """Elimination without pivoting is not trusted with an indefinite mass matrix."""
    model = ROBOTS["mimic"]
    odd = replace(model.links[2].inertial or Inertial(1.0), ixx=-5.0)
    links = [replace(link, inertial=odd) if k == 2 else link for k, link in enumerate(model.links)]
    bad = Model.build("bad", links, model.joints)
    assert is_physical(model.mechanism)
    assert not is_physical(bad.mechanism)
    engine = made(bad)
    q, v, a = state(bad, (3,))
    found = engine.forward_dynamics(q, v, a)
    assert not any(key[0] == "forward_dynamics" for key in engine._calls if isinstance(key, tuple))
    Closeness(samples_at(bad, q, v, found)).check("inverse_dynamics", engine.inverse_dynamics(q, v, found), a)


@pytest.mark.parametrize("quantity", sorted({*QUANTITIES} & {*HOOK_OF_QUANTITY}))
@pytest.mark.parametrize("robot", ["fixed", "floating mimic"])
def test_what_is_not_compiled_is_evaluated(
    quantity: str, robot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = ROBOTS[robot]
    kernels, reference = made(model), backend("reference", model)
    monkeypatch.setattr(compiled_kernels, "LONGEST", 0)
    numbers = made(model)
    q, v, a = state(model, (3,))
    arguments: dict[str, Any] = {"q": q, "v": v, "a": a, "tau": a}
    values = [arguments[name] for name in QUANTITIES[quantity].arguments]
    frame = [TIP] if quantity.startswith(("jacobian", "frame")) else []
    answers = [getattr(each, quantity)(*values, *frame) for each in (numbers, reference)]
    np.testing.assert_array_equal(answers[0].shape, answers[1].shape)
    close = Closeness(samples_at(model, q, v, a, a))
    if quantity == "forward_dynamics":
        quantity, answers = "inverse_dynamics", [reference.inverse_dynamics(q, v, answers[0]), a]
        close = Closeness(samples_at(model, q, v, numbers.forward_dynamics(q, v, a)))
    close.check(quantity, answers[0], answers[1])
    assert numbers._calls
    assert all(isinstance(call, NumericCall) for call in numbers._calls.values())
    assert not kernels._calls


def test_what_grows_too_long_is_not_compiled() -> None:
    assert compiles(chain(30).mechanism, "mass_matrix")
    assert not compiles(chain(60).mechanism, "mass_matrix")
    assert compiles(chain(60).mechanism, "inverse_dynamics")
    assert compiles(chain(9).mechanism, "coriolis_matrix")
    assert not compiles(chain(20).mechanism, "coriolis_matrix")


def test_dust_is_what_rounding_left() -> None:
    """Right angles become exact, and nothing else changes."""
    pose = Pose((0.1, 0.2, 0.3), (np.pi / 2, 0.0, -np.pi / 2))
    links = [Link("a"), Link("b", Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1))]
    model = Model.build("square", links, [Joint("j", "revolute", "a", "b", pose)]).with_frame("f", "b", pose)
    before, after = model.mechanism, tidied(model.mechanism)
    assert np.count_nonzero(before.bodies[0].R) > 3
    for R in (after.bodies[0].R, after.frames[-1].R):
        assert np.count_nonzero(R) == 3
        np.testing.assert_array_equal(np.abs(R[R != 0.0]), 1.0)
    np.testing.assert_array_equal(tidied(after).bodies[0].R, after.bodies[0].R)
    oblique = mixed_robot().mechanism
    for old, new in zip(oblique.bodies, tidied(oblique).bodies, strict=True):
        np.testing.assert_array_equal(old.R, new.R)


def _variants(mechanism: Mechanism) -> list[Mechanism]:
    """Every number of the mechanism changed by its last bit, one after another."""
    found = [
        replace(mechanism, gravity=np.nextafter(mechanism.gravity, 99.0)),
        replace(mechanism, floating=not mechanism.floating),
        replace(mechanism, coupling=None),
        replace(mechanism, bodies=mechanism.bodies[:-1]),
        replace(mechanism, frames=mechanism.frames[:-1]),
        replace(mechanism, root=replace(mechanism.root, mass=mechanism.root.mass + 1.0)),
    ]
    body, frame = mechanism.bodies[1], mechanism.frames[1]
    inertia = body.inertia
    changed_bodies = [replace(body, revolute=not body.revolute), replace(body, parent=-1)]
    changed_bodies += [
        replace(body, **{name: np.nextafter(getattr(body, name), 99.0)}) for name in ("R", "p", "axis")
    ]
    for name in (field.name for field in fields(inertia)):
        changed = replace(inertia, **{name: np.nextafter(getattr(inertia, name), 99.0)})
        changed_bodies.append(replace(body, inertia=changed))
    first, *rest = mechanism.bodies
    found += [replace(mechanism, bodies=(first, changed, *rest[1:])) for changed in changed_bodies]
    for name in ("R", "p"):
        moved = replace(frame, **{name: np.nextafter(getattr(frame, name), 99.0)})
        found.append(replace(mechanism, frames=(mechanism.frames[0], moved, *mechanism.frames[2:])))
    coupling = mechanism.coupling
    assert coupling is not None
    found.append(replace(mechanism, coupling=replace(coupling, offset=tuple(x + 1 for x in coupling.offset))))
    found.append(replace(mechanism, coupling=replace(coupling, scale=tuple(2 * x for x in coupling.scale))))
    return found


def test_every_number_of_the_robot_is_in_the_key() -> None:
    model = ROBOTS["mimic"]
    variants = [model.mechanism, *_variants(model.mechanism)]
    assert len({_fingerprint(variant) for variant in variants}) == len(variants)
    assert _fingerprint(build_mechanism(model)) == _fingerprint(build_mechanism(model))


def test_warm_from_the_cache_nothing_is_traced(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(os.environ, "DYNX_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("DYNX_CACHE", raising=False)
    model = ROBOTS["floating"]
    q, v, a = state(model)
    cold = made(model).inverse_dynamics(q, v, a)

    def traced(*_: object) -> None:
        raise AssertionError("traced again")

    monkeypatch.setattr(compiled_kernels, "trace", traced)
    np.testing.assert_array_equal(made(model).inverse_dynamics(q, v, a), cold)


def test_robots_without_joints() -> None:
    rock = Model.build("rock", [Link("rock", Inertial(2.0))], [])
    for model in (rock, rock.with_base("floating")):
        engine, reference = made(model), backend("reference", model)
        for size in ((), (0,), (5,), (FEW + 1,)):
            q, v, a = state(model, size)
            assert engine.mass_matrix(q).shape == (*size, model.nv, model.nv)
            for name in ("inverse_dynamics", "forward_kinematics", "kinetic_energy"):
                given = {"inverse_dynamics": (q, v, a), "kinetic_energy": (q, v)}.get(name, (q,))
                if name == "inverse_dynamics" or size:
                    assert getattr(engine, name)(*given).shape == getattr(reference, name)(*given).shape


def test_it_is_found_by_name_and_says_what_it_is() -> None:
    engine = dynx.backend("compiled", chain(1))
    assert "compiled" in dynx.installed_backends()
    for word in ("dynx", "llvmlite", "LLVM"):
        assert word in engine.engine_version
