"""Functions that worker processes run in tests: they return, exit, hang or raise."""

from __future__ import annotations

import os
import signal
import time
from typing import Any

from dynx.agreement import AgreementReport
from dynx.agreement.agreement import AgreementTask, measure
from dynx.doctor.report import DoctorReport
from dynx.doctor.task import DoctorTask
from tests.doctor.formats.reports import differing


def act(task: Any) -> Any:
    """Do what `task` says; any other task is returned with the number of the process."""
    if task == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    elif task == "exit":
        os._exit(7)
    elif task == "hang":
        time.sleep(600.0)
    elif task == "raise":
        raise ZeroDivisionError("no reason")
    elif task == "print":
        os.write(1, b"an engine says hello\n" * 1000)
    return task, os.getpid()


def crash_on_panda(task: AgreementTask) -> AgreementReport:
    """Measure, but end the process at the robot `panda` as an engine would."""
    if task.robot == "panda":
        os.kill(os.getpid(), signal.SIGSEGV)
    return measure(task)


def interrupt_at_a_pipe(task: DoctorTask) -> DoctorReport:
    """A report made by hand; for a robot that is a FIFO, press Ctrl-C once something is written there."""
    if task.robot.endswith(".fifo"):
        with open(task.robot) as pipe:
            pipe.read()
        os.kill(os.getppid(), signal.SIGINT)
        signal.pause()
    return differing(task.robot)
