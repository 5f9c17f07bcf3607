"""Output of engines is kept from the streams of the process, and can be captured."""

from __future__ import annotations

import ctypes
import os
import sys

import pytest

from dynx.engines.silence import capture_output, silence


def speak(words: str) -> None:
    """On every way out: Python's streams, the C library's buffer, the descriptors."""
    print(f"{words} stdout")
    print(f"{words} stderr", file=sys.stderr)
    ctypes.CDLL(None).printf(f"{words} printf\n".encode())
    os.write(2, f"{words} write\n".encode())


@pytest.mark.skipif(sys.platform == "win32", reason="reaches for the C library as on POSIX")
def test_nothing_comes_out_meanwhile_and_all_of_it_before_and_after(
    capfd: pytest.CaptureFixture[str],
) -> None:
    speak("before")
    with silence():
        speak("meanwhile")
        sys.stdout.flush()
    speak("after")
    ctypes.CDLL(None).fflush(None)
    out, err = capfd.readouterr()
    for word in ("stdout", "printf"):
        assert (f"before {word}" in out, f"after {word}" in out) == (True, True)
    for word in ("stderr", "write"):
        assert (f"before {word}" in err, f"after {word}" in err) == (True, True)
    assert "meanwhile printf" not in out
    assert "meanwhile write" not in err


@pytest.mark.skipif(sys.platform == "win32", reason="reaches for the C library as on POSIX")
def test_captured_output_comes_line_by_line(capfd: pytest.CaptureFixture[str]) -> None:
    lines = ["kept"]
    with capture_output(lines):
        ctypes.CDLL(None).printf(b"  one\n\n")
        ctypes.CDLL(None).fflush(None)
        os.write(2, b"two \xff\nthree")
    assert lines == ["kept", "one", "two \N{REPLACEMENT CHARACTER}", "three"]
    assert capfd.readouterr() == ("", "")


def test_what_was_said_before_an_error_is_kept() -> None:
    lines: list[str] = []

    def fail() -> None:
        with capture_output(lines):
            os.write(1, b"printed\n")
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        fail()
    assert lines == ["printed"]
