"""Report what a process of Python opens, executes and connects to; Python imports this module at its start.

The variable DYNX_ATTACK_LOG names the file of the report: a line of JSON for each event.
"""

import json
import os
import sys

HEARD = {
    "open": 0,
    "os.listdir": 0,
    "os.scandir": 0,
    "subprocess.Popen": 0,
    "os.system": 0,
    "os.exec": 0,
    "os.posix_spawn": 0,
    "os.spawn": 1,
    "pty.spawn": 0,
    "socket.connect": 1,
    "socket.getaddrinfo": 0,
    "socket.sendto": 1,
    "urllib.Request": 0,
    "ctypes.dlopen": 0,
}
"""Events of Python's audit hook, and the place of the argument that matters."""

LOG = os.environ.get("DYNX_ATTACK_LOG")


def report_events(path: str) -> None:
    """Add the hook that writes events to a file."""
    out = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)

    def hear(event: str, arguments: tuple[object, ...]) -> None:
        place = HEARD.get(event)
        if place is None or len(arguments) <= place:
            return
        what = arguments[place]
        text = os.fsdecode(what) if isinstance(what, (str, bytes, os.PathLike)) else str(what)
        if sys._getframe(1).f_code.co_name == "_rmtree_safe_fd":
            return  # The name is one in a folder that is deleted, not in the current one.
        if event in ("open", "os.listdir", "os.scandir") and not isinstance(what, int):
            text = os.path.abspath(text)
        os.write(out, (json.dumps([event, text]) + "\n").encode())

    sys.addaudithook(hear)


if LOG:
    report_events(LOG)
