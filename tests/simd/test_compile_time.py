"""Long programs: compiled without optimisation, in bounded time for each operation, and interruptible."""

from __future__ import annotations

import re
import threading
from dataclasses import replace

import numpy as np
import pytest

from dynx.simd import emit, image
from dynx.simd.image import COMPILE_LOCK, compile_text
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.schedule import program_length
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array


def chain(x: Array) -> Array:
    """Multiply and add each number of a vector to every other, for some thousand operations."""
    for _ in range(40):
        x = np.array([a * b + 0.5 for a, b in zip(x, np.roll(x, 1), strict=True)], dtype=object) * 0.5
    return x


def long_program() -> Program:
    return trace(chain, {"x": (10,)})


def lock_is_free() -> bool:
    """Check whether another thread can compile."""
    found = []

    def acquire() -> None:
        found.append(COMPILE_LOCK.acquire(timeout=5.0))
        if found[0]:
            COMPILE_LOCK.release()

    thread = threading.Thread(target=acquire)
    thread.start()
    thread.join()
    return found[0]


def test_the_length_of_a_program_counts_results_and_functions_more_than_sums() -> None:
    assert program_length(trace(lambda x: x + 1.0, {"x": (3,)})) == 3 + 2 * 3
    assert program_length(trace(lambda x: np.sin(x), {"x": (3,)})) == 3 * (25 + 2)


def test_only_long_programs_are_compiled_without_optimisation(monkeypatch: pytest.MonkeyPatch) -> None:
    program = long_program()
    plain = Kernel(program)
    monkeypatch.setattr(emit, "MAX_OPTIMISED_LENGTH", program_length(program) - 1)
    quick = Kernel(program)
    assert len(quick.image.objects) > len(plain.image.objects)
    assert emit.Settings(4).for_length(program_length(program)).quick
    assert not emit.Settings(4).for_length(program_length(program) - 1).quick
    x = np.random.default_rng(0).standard_normal((9, 10))
    found, other = np.empty((9, 10)), np.empty((9, 10))
    quick([x], [found])
    plain([x], [other])
    np.testing.assert_allclose(found, other, rtol=1e-9)
    wanted = np.array([chain(row) for row in x], dtype=np.float64)
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_segments_without_optimisation_share_modules() -> None:
    program, lanes = long_program(), host().lanes
    settings = emit.Settings(lanes, segment=100)
    alone = emit.emit_modules(program, host(), settings)
    together = emit.emit_modules(program, host(), replace(settings, quick=True))
    for modules in (alone, together):
        assert "".join(module.text for module in modules).count("define  void @segment") == len(alone) - 1
    assert max(len(module.text) for module in together) < 2 * emit.MAX_QUICK_MODULE
    assert 2 * len(together) < len(alone)


def test_segments_without_optimisation_only_load_compute_and_store() -> None:
    """After any other instruction LLVM takes three times as long for the whole segment."""
    settings = emit.Settings(host().lanes, segment=100, quick=True)
    modules = emit.emit_modules(long_program(), host(), settings)
    *segments, rows, _ = (module.text for module in modules)
    operations = {
        match[1] for text in segments for match in re.finditer(r"^  %\d+ = (\w+)", text, re.MULTILINE)
    }
    assert operations == {"load", "getelementptr", "fadd", "fmul"}
    assert "shufflevector" in rows


def test_the_calls_for_distant_angles_are_written_once() -> None:
    program = trace(lambda x: np.sin(x) * np.cos(x), {"x": (20,)})
    text = emit.emit(program, host(), emit.Settings(host().lanes))
    for function in ("sin", "cos"):
        assert text.count(f"call double @{function}(") == host().lanes


def test_an_interrupted_compilation_leaves_the_compiler_usable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(emit, "MAX_OPTIMISED_LENGTH", 0)
    monkeypatch.setattr(emit, "MAX_QUICK_MODULE", 0)
    compiled = []

    def interrupted(*arguments: object, **options: object) -> bytes:
        compiled.append(arguments)
        if len(compiled) == 2:
            raise KeyboardInterrupt
        return compile_text(*arguments, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(image, "compile_text", interrupted)
    program = long_program()
    modules = len(emit.emit_modules(program, host(), emit.Settings(host().lanes).for_length(1)))
    with pytest.raises(KeyboardInterrupt):
        Kernel(program)
    assert len(compiled) < modules
    assert lock_is_free()
    x, found = np.ones((9, 10)), np.empty((9, 10))
    Kernel(program)([x], [found])
    np.testing.assert_allclose(found, [chain(x[0]).astype(np.float64)] * 9, rtol=1e-9)
