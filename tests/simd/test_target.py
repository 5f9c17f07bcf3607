"""What follows from the description of a processor."""

from __future__ import annotations

import pytest

from dynx.simd.target import Processor, host


@pytest.mark.parametrize(
    ("triple", "features", "fma", "lanes", "short"),
    [
        ("x86_64-unknown-linux-gnu", "", False, 2, True),
        ("x86_64-unknown-linux-gnu", "+sse4.2,-avx,-fma,-avx512f", False, 2, True),
        ("x86_64-unknown-linux-gnu", "+avx,+fma4", False, 4, True),
        ("x86_64-apple-darwin", "+avx,+avx2,+fma", True, 4, True),
        ("x86_64-pc-windows-msvc", "+avx,+fma,+avx512f", True, 8, False),
        ("aarch64-unknown-linux-gnu", "+neon", True, 2, False),
        ("arm64-apple-darwin", "", True, 2, False),
        ("aarch64-pc-windows-msvc", "", True, 2, False),
    ],
)
def test_vectors_multiply_add_and_addresses(
    triple: str, features: str, fma: bool, lanes: int, short: bool
) -> None:
    processor = Processor(triple, "generic", features)
    assert (processor.fma, processor.lanes, processor.short_addresses) == (fma, lanes, short)


def test_this_machine_is_one_that_code_can_be_made_for() -> None:
    for quick in (False, True):
        assert host().machine(quick=quick).triple == host().triple
