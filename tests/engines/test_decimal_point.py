"""Files are read alike in a program whose locale has a decimal comma."""

from __future__ import annotations

import locale
import os
import shutil
import subprocess
import sys

import pytest

from dynx.engines import decimal_point as module
from dynx.engines.decimal_point import decimal_point

GERMAN = "de_DE.UTF-8"

PROGRAM = """
import locale
import dynx
locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
assert locale.localeconv()["decimal_point"] == ","
report = dynx.diagnose("ur5", samples=2)
assert report.explained, report.verdict
assert not any(each.refused for each in report.engines)
assert max(error for each in report.engines for error in each.before.values()) < 1e-8, report.engines
model = dynx.load("ur5")
engine, reference = dynx.backend("pybullet", model), dynx.backend("reference", model)
q = [0.5] * 6
assert abs(engine.mass_matrix(q) - reference.mass_matrix(q)).max() < 1e-12
assert locale.localeconv()["decimal_point"] == ","
"""


@pytest.fixture(scope="module")
def german(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """An environment in which the German locale exists, made for the test where the system lacks it."""
    if shutil.which("localedef") is None:
        pytest.skip("no localedef")
    folder = tmp_path_factory.mktemp("locales")
    made = subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / GERMAN)], capture_output=True, check=False
    )
    if not (folder / GERMAN).exists():
        pytest.skip(f"no German locale: {made.stderr.decode()}")
    return {**os.environ, "LOCPATH": str(folder)}


def test_every_engine_loads_a_file_under_a_decimal_comma(german: dict[str, str]) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=german, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_locale_of_a_thread_is_restored_after_an_error(german: dict[str, str]) -> None:
    program = """
import ctypes, locale, threading
from dynx.engines.decimal_point import decimal_point
c = ctypes.PyDLL(None)
c.atof.restype = ctypes.c_double
locale.setlocale(locale.LC_ALL, "de_DE.UTF-8")
others = []
try:
    with decimal_point():
        assert c.atof(b"1.5") == 1.5
        thread = threading.Thread(target=lambda: others.append(c.atof(b"1.5")))
        thread.start(), thread.join()
        with decimal_point():
            assert c.atof(b"1.5") == 1.5
        assert c.atof(b"1.5") == 1.5
        raise KeyError
except KeyError:
    pass
assert c.atof(b"1.5") == 1.0, "restored"
assert others == [1.0], "another thread keeps its locale"
"""
    done = subprocess.run(
        [sys.executable, "-c", program], env=german, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_without_locales_of_threads_the_locale_of_the_process_is_restored(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    calls = []
    monkeypatch.setattr(module, "_posix", lambda: None)

    def setlocale(category: int, name: str | None = None) -> str:
        calls.append(name)
        return "some locale"

    monkeypatch.setattr(locale, "setlocale", setlocale)
    with pytest.raises(KeyError), decimal_point():
        raise KeyError
    assert calls == [None, "C", "some locale"]
