"""Functions that victims call beside the command line: ``python -m tests.security.doors NAME WORDS...``.

An error of dynx is reported as the command line reports it; any other ends the process with a traceback.
"""

from __future__ import annotations

import sys

from dynx.cli.shell.exits import report_failure
from dynx.errors import DynxError


def world(path: str, steps: str = "0") -> None:
    """Read a world with its state, and step it."""
    from dynx.world import World

    with World.read(path) as found:
        found.step(int(steps))
        print(found.time)


def rollout(path: str) -> None:
    """Read a rollout, and show it as a notebook does."""
    import dynx

    found = dynx.Rollout.load(path)
    print(ascii(found._repr_html_()))


def table(path: str, robot: str) -> None:
    """Read the log of a robot."""
    import dynx

    print(len(dynx.Rollout.load(path, dynx.load(robot))))


def saved(robot: str, *paths: str) -> None:
    """Simulate a robot, and write the record to files."""
    import dynx
    from dynx import control

    model = dynx.load(robot)
    law = control.PD(model, kp=1.0, kd=1.0)
    found = dynx.simulate(model, law, [0.3], plant="reference", duration=0.01, control_dt=0.005)
    for path in paths:
        found.save(path)


def hull(path: str) -> None:
    """Read a mesh, and make its convex hull."""
    from dynx.model.geometry import Mesh

    print(len(Mesh(path).hull[0]))


def drawn(path: str) -> None:
    """Read what a mesh looks like."""
    from dynx.model.geometry import Mesh

    mesh = Mesh(path)
    for part, look in mesh.parts:
        print(look.rgba, part.surface.texture and part.surface.texture.pixels.shape, len(part.surface.faces))
    print(*mesh.notes, sep="\n")


def seen(path: str) -> None:
    """Draw the shapes of a robot, and print what they are drawn without."""
    import dynx
    from dynx.model.geometry.drawn_shapes import link_look_notes, link_shapes

    model = dynx.load(path)
    for link in model.links:
        print(*link_shapes(model.geometry, link.name))
        print(*link_look_notes(model.geometry, link.name), sep="\n")


def resumed(folder: str) -> None:
    """Go on with the run of `tests.security.surfaces.run_folder`."""
    from tests.security.surfaces.run_folder import train_to

    train_to(96, folder, resume=True)


def policy(path: str) -> None:
    """Load a policy, and let it act."""
    import numpy as np

    from dynx.training import load_policy

    print(load_policy(path)(np.zeros(4, np.float32)))


def socket(name: str) -> None:
    """Open the page of a robot, and attack its socket."""
    from tests.security.surfaces import published_pages  # noqa: F401  # registers its own
    from tests.security.surfaces import socket as attacks

    print(attacks.SENT[name]())


def program(text: str) -> None:
    """Run a program of the tests, which breaks a rule."""
    exec(text, {})


def run(name: str, words: list[str]) -> None:
    """Call a function of this module; end the process with 2 for an error of dynx."""
    try:
        globals()[name](*words)
    except DynxError as error:
        sys.exit(report_failure(error, "dynx"))


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2:])
