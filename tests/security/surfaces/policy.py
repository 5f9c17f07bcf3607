"""Attacks by files of policies: `dynx play`, `load_policy`."""

from __future__ import annotations

import base64
import io
import json
import os
import pickle
import struct
import tempfile
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from tests.security.attack import Box, Deed, Harmful, archive_of, attacks_on, sparse

attack = attacks_on("policy")

PLAY = ("--episodes", "1", "--quiet")


@cache
def parts() -> dict[str, bytes]:
    """Return the members of the file of a policy."""
    from dynx.training import Schedule, train
    from tests.training.runs import small_run

    with tempfile.TemporaryDirectory() as folder:
        train(small_run(32, normalize=True), folder, schedule=Schedule(episodes=1), final_episodes=1)
        with zipfile.ZipFile(Path(folder) / "final.zip") as archive:
            return {name: archive.read(name) for name in archive.namelist()}


def deed(box: Box, members: dict[str, bytes], *, ends: tuple[int, ...] = (2,), **options: Any) -> Deed:
    """Write a policy, which the victim plays."""
    return Deed(("play", box.file("p.zip", archive_of(members, **options)), *PLAY), ends=ends)


def changed(box: Box, change: Callable[[dict[str, Any]], object], ends: tuple[int, ...] = (2,)) -> Deed:
    """Write a policy whose document is changed."""
    document = json.loads(parts()["dynx.json"])
    change(document)
    return deed(box, {**parts(), "dynx.json": json.dumps(document).encode()}, ends=ends)


def task(box: Box, **task: Any) -> Deed:
    """Write a policy for another task."""
    return changed(box, lambda document: document["spec"]["task"].update(task))


def torch_file(*content: bytes, names: tuple[str, ...] = ("archive/data.pkl",)) -> bytes:
    """Return a file of tensors in PyTorch's format, with a pickle of the attacker's."""
    members = dict(zip(names, content, strict=True))
    return archive_of({**members, "archive/version": b"3\n", "archive/byteorder": b"little"})


@attack("code", "pickle in the weights")
def _(box: Box) -> Deed:
    return deed(box, {**parts(), "policy.pth": pickle.dumps(Harmful(box.owned))})


@attack("code", "pickle in an archive of tensors")
def _(box: Box) -> Deed:
    return deed(box, {**parts(), "policy.pth": torch_file(pickle.dumps(Harmful(box.owned), 2))})


@attack("code", "pickle in the data of stable-baselines3")
def _(box: Box) -> Deed:
    data = json.loads(parts()["data"])
    serialized = base64.b64encode(pickle.dumps(Harmful(box.owned))).decode()
    data |= {name: {":type:": "x", ":serialized:": serialized} for name in ("policy_class", "lr_schedule")}
    return deed(box, {**parts(), "data": json.dumps(data).encode()}, ends=(0,))


@attack("code", "module in the id of the task")
def _(box: Box) -> Deed:
    box.file("planted.py", f"{box.code}\n")
    return task(box, id="planted:Own-v0")


@attack("code", "robot that xacro expands")
def _(box: Box) -> Deed:
    box.file("r.xacro", (box.outside / "secret.xacro").read_text())
    return task(box, id="dynx/Reach-v0", options={"robot": "r.xacro"})


@attack("code", "class of the task")
def _(box: Box) -> Deed:
    return task(box, id="dynx/Reach-v0", options={"task": "os:system"})


@attack("code", "extractor of features by name")
def _(box: Box) -> Deed:
    options = {"features_extractor_class": "os.system", "features_extractor_kwargs": {"command": "id"}}
    return changed(box, lambda document: document["spec"]["hyperparameters"].update(policy_kwargs=options))


@attack("path", "robot outside")
def _(box: Box) -> Deed:
    return task(box, id="dynx/Reach-v0", options={"robot": "../outside/secret.urdf"})


@attack("path", "mesh in the text of a robot")
def _(box: Box) -> Deed:
    mesh = f'<mesh filename="file://{box.outside}/secret.stl"/>'
    urdf = f'<robot name="r"><link name="a"><visual><geometry>{mesh}</geometry></visual></link></robot>'
    return task(box, id="dynx/Reach-v0", options={"robot": urdf})


@attack("path", "members that lead out of a folder")
def _(box: Box) -> Deed:
    return deed(box, {"../../outside/new": b"x", str(box.outside / "new2"): b"x", **parts()}, ends=(0, 2))


@attack("device", "endless device behind a link")
def _(box: Box) -> Deed:
    (box.here / "p.zip").symlink_to("/dev/zero")
    return Deed(("play", "p.zip", *PLAY))


@attack("device", "pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "p.zip")
    return Deed(("play", "p.zip", *PLAY))


@attack("bomb", "compressed members")
def _(box: Box) -> Deed:
    members = {**parts(), "policy.optimizer.pth": bytes(3 * 10**8)}
    return deed(box, members, compression=zipfile.ZIP_DEFLATED)


@attack("bomb", "compressed document")
def _(box: Box) -> Deed:
    members = {**parts(), "dynx.json": b" " * 5 * 10**8}
    return deed(box, members, compression=zipfile.ZIP_DEFLATED)


@attack("bomb", "sizes of a member that are false")
def _(box: Box) -> Deed:
    data = bytearray(archive_of(parts()))
    at = data.rfind(b"PK\x01\x02", 0, data.rfind(b"dynx.json"))
    struct.pack_into("<II", data, at + 20, 0x7FFFFFFF, 0x7FFFFFFF)
    return Deed(("play", box.file("p.zip", bytes(data)), *PLAY))


@attack("bomb", "lists that hold the same list many times")
def _(box: Box) -> Deed:
    nested: list[Any] = []
    for _ in range(60):
        nested = [nested, nested]
    return deed(box, {**parts(), "policy.pth": torch_file(pickle.dumps(nested, 2))})


@attack("bomb", "tensor that repeats one number")
def _(box: Box) -> Deed:
    import torch

    content = io.BytesIO()
    torch.save({"log_std": torch.zeros(1).expand(3 * 10**9)}, content)
    return deed(box, {**parts(), "policy.pth": content.getvalue()})


@attack("bomb", "layers and buffers beyond all memory")
def _(box: Box) -> Deed:
    numbers = {"n_steps": 10**15, "policy_kwargs": {"net_arch": [10**9, 10**9]}}
    return changed(box, lambda document: document["spec"]["hyperparameters"].update(numbers))


@attack("bomb", "many environments")
def _(box: Box) -> Deed:
    return changed(box, lambda document: document["spec"].update(envs=10**9), ends=(0, 2))


@attack("bomb", "sparse file")
def _(box: Box) -> Deed:
    sparse(box.here / "p.zip", 2**36, b"PK\x03\x04")
    return Deed(("play", "p.zip", *PLAY))


@attack("recursion", "deep document")
def _(box: Box) -> Deed:
    return deed(box, {**parts(), "dynx.json": b"[" * 200_000})


@attack("recursion", "deep options of the task")
def _(box: Box) -> Deed:
    deep: Any = 0
    for _ in range(400):
        deep = [deep]
    return changed(box, lambda document: document["spec"]["task"].update(options={"a": deep}))


@attack("type", "numbers of other types")
def _(box: Box) -> Deed:
    return changed(box, lambda document: document["spec"].update(seed=[1], steps={"a": 1}))


@attack("type", "scaling with NaN and negative variance")
def _(box: Box) -> Deed:
    scaling = {"observation_mean": [None] * 4, "observation_variance": [-1.0] * 4}
    return changed(box, lambda document: document.update(scaling))


@attack("type", "member that is there twice")
def _(box: Box) -> Deed:
    content = io.BytesIO(archive_of(parts()))
    with zipfile.ZipFile(content, "a") as archive:
        archive.writestr("dynx.json", b"[]")
    return Deed(("play", box.file("p.zip", content.getvalue()), *PLAY))


@attack("terminal", "escape sequences in the id of the task")
def _(box: Box) -> Deed:
    return task(box, id="CartPole\x1b]0;owned\x07\x1b[2J\u202e-v1")


@attack("printf", "formats in names")
def _(box: Box) -> Deed:
    return changed(box, lambda document: document["spec"].update({"%s%n{0.__class__}": "%d" * 50}))
