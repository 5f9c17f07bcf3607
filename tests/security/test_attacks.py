"""Attacks on every surface are held: a part of them here, in one process, and all of them by
``python -m tests.security.attacks``."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.security.attack import ATTACKS, Attack, Box, Deed, make_box
from tests.security.surfaces import every
from tests.security.victims import attacked_apart, attacked_together

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="devices, pipes and memory are those of Linux"
)

SURFACES = (
    "policy",
    "run folder",
    "scene",
    "urdf",
    "mjcf",
    "sdf",
    "mesh",
    "world",
    "npz",
    "csv",
    "mcap",
    "page",
    "view",
    "socket",
)

OF_A_SURFACE = 2
"""Number of attacks on each surface that are tried here; the whole takes minutes."""

QUICK = ("path", "link", "device", "terminal", "printf", "code", "access", "html")
"""Kinds whose attacks take no time."""

assert every.ATTACKS is ATTACKS


def sampled() -> list[Attack]:
    """Return attacks of every surface, spread over its own, that take no time."""
    found = []
    for surface in SURFACES[2:]:
        quick = [each for each in ATTACKS if each.surface == surface and each.kind in QUICK]
        found += quick[:: max(1, len(quick) // OF_A_SURFACE)][:OF_A_SURFACE]
    return found


def test_attacks_are_held(tmp_path: Path) -> None:
    found = attacked_together(sampled(), tmp_path)
    assert {name: wrong for name, wrong in found.items() if wrong} == {}


def test_every_surface_is_attacked() -> None:
    counts = Counter(each.surface for each in ATTACKS)
    wanted = SURFACES if every.TRAINING else SURFACES[2:]
    assert set(counts) == set(wanted)
    assert min(counts.values()) >= 8
    assert len({each.key for each in ATTACKS}) == len(ATTACKS) >= 100
    assert {each.surface for each in sampled()} == set(SURFACES[2:])


BREACHES = {
    "executed": "import os; os.system('touch ../owned')",
    "opened": "open('../outside/secret.txt')",
    "showed a secret": "print(open('../outside/secret.txt').read())",
    "wrote outside": "open('../outside/new', 'w')",
    "connected": "import socket; socket.socket(2, 2).connect(('192.0.2.1', 9))",
    "traceback": "raise ValueError",
    "control characters": r"print('\x1b[2J')",
    "exit code 3": "raise SystemExit(3)",
    "GB": "b'x' * (21 * 10**8)",
}
"""Programs that break a rule, by what is found of them."""


@pytest.mark.parametrize("wanted", BREACHES)
def test_a_breach_is_found(wanted: str, tmp_path: Path) -> None:
    def prepare(_: Box) -> Deed:
        return Deed((BREACHES[wanted],), "program", (0,))

    found = attacked_together([Attack("test", "code", wanted, prepare)], tmp_path)
    assert any(wanted in each for each in found[f"test/{wanted}"]), found


def test_a_breach_is_found_in_a_process_of_its_own(tmp_path: Path) -> None:
    """What a program started by the victim does is seen by strace alone."""
    program = "import subprocess; subprocess.run(['cat', '../outside/secret.txt'])"
    attack = Attack("test", "code", "child", lambda _: Deed((program,), "program", (0,)))
    found = " ".join(attacked_apart(attack, tmp_path))
    assert "executed" in found
    assert "showed a secret" in found


def test_the_box_has_secrets(tmp_path: Path) -> None:
    box = make_box(tmp_path / "box")
    assert len(list(box.outside.iterdir())) >= 6
    assert not list(box.here.iterdir())
