"""Attacks on files that a command reads beside its robot: baselines, runs, statistics; and on odd names."""

from __future__ import annotations

import json
import os
import pickle

from tests.security.attack import TRAINING, Box, Deed, Harmful, attacks_on
from tests.security.surfaces.description import arm, info, mesh
from tests.security.surfaces.scene import deed as scene_deed
from tests.security.surfaces.table import GOOD
from tests.security.surfaces.table import deed as table_deed

CONTROLS = "a\x1b[2J\x07\u202e\u2066\r\x9b31m"
"""Text that would clear a terminal."""

# -- what the doctor reads beside the description -------------------------------------------------

urdf = attacks_on("urdf")


def with_baseline(box: Box, name: str, ends: tuple[int, ...] = (2,)) -> Deed:
    """Return the examination of a robot against a baseline."""
    robot = box.file("r.urdf", arm())
    return Deed(("doctor", robot, "--samples", "1", "--baseline", name), ends=ends)


@urdf("device", "baseline that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "b.json")
    return with_baseline(box, "b.json")


@urdf("device", "baseline that leads to an endless device")
def _(box: Box) -> Deed:
    (box.here / "b.json").symlink_to("/dev/zero")
    return with_baseline(box, "b.json")


@urdf("recursion", "deep baseline")
def _(box: Box) -> Deed:
    return with_baseline(box, box.file("b.json", "[" * 10**6))


@urdf("terminal", "baseline whose words are escape sequences")
def _(box: Box) -> Deed:
    return with_baseline(box, box.file("b.json", json.dumps({"schema": CONTROLS, CONTROLS: [CONTROLS]})))


@urdf("printf", "baseline whose words are formats")
def _(box: Box) -> Deed:
    return with_baseline(box, box.file("b.json", json.dumps({"schema": "%s%n{0.__class__}"})))


@urdf("link", "mended file that a link leads outside")
def _(box: Box) -> Deed:
    robot = box.file("r.urdf", arm(extra="<visual/>").replace('ixx="1"', 'ixx="9"'))
    (box.here / "mended").symlink_to(box.outside)
    return Deed(("doctor", robot, "--samples", "1", "--fix", "mended/../mended"), ends=(0, 1, 2))


@urdf("path", "meshes by addresses of files, of shares and of data")
def _(box: Box) -> Deed:
    names = (
        f"file://localhost{box.outside}/secret.stl",
        f"file:{box.outside}/secret.stl",
        f"//localhost{box.outside}/secret.stl",
        "\\\\server\\share\\a.stl",
        "data:model/stl;base64,AAAA",
        f"package://.{box.outside}/secret.stl",
        "package:///../outside/secret.stl",
        "package://a/%2e%2e/%2e%2e/outside/secret.stl",
        "model://../outside/secret.stl",
    )
    shapes = "".join(map(mesh, names))
    return Deed(("agree", box.file("r.urdf", arm(extra=shapes))), ends=(0, 1, 2))


@urdf("network", "meshes by protocols of other machines")
def _(box: Box) -> Deed:
    names = ("ftp://127.0.0.2/a.stl", "HTTPS://127.0.0.2/a.stl", "smb://127.0.0.2/a.stl", "s3://a/b.stl")
    return Deed(("agree", box.file("r.urdf", arm(extra="".join(map(mesh, names))))), ends=(0, 1, 2))


@urdf("terminal", "names that imitate the words of dynx")
def _(box: Box) -> Deed:
    return info(box, arm("dynx: error: all is well\ndynx: error: again"), ends=(0, 2))


# -- scenes and tables ----------------------------------------------------------------------------

in_scene = attacks_on("scene")


@in_scene("path", "robot by an address of a file")
def _(box: Box) -> Deed:
    return scene_deed(box, {"robots": [{"name": "a", "robot": f"file://{box.outside}/secret.urdf"}]})


@in_scene("bomb", "constraint of a part with itself, a hundred thousand times")
def _(box: Box) -> Deed:
    body = {"name": "b", "mass": 1.0, "shape": {"box": [0.1, 0.1, 0.1]}}
    return scene_deed(
        box, {"bodies": [body], "constraints": [{"type": "weld", "a": "b", "b": "b"}] * 100_000}
    )


@in_scene("type", "keys that differ in composed letters alone")
def _(box: Box) -> Deed:
    body = {"mass": 1.0, "shape": {"box": [0.1, 0.1, 0.1]}}
    names = ("caf\u00e9", "cafe\u0301")
    return scene_deed(box, {"bodies": [{"name": name, **body} for name in names]}, ends=(0, 2))


in_table = attacks_on("csv")


@in_table("terminal", "lines that go back over themselves in a header")
def _(box: Box) -> Deed:
    return table_deed(box, f"t,q:joint,{CONTROLS}\n" + GOOD.partition("\n")[2].replace("\n", ",0\n"))


@in_table("bomb", "exponents without end")
def _(box: Box) -> Deed:
    return table_deed(box, f"t,q:joint\n0,1e{'9' * 10**6}\n1,1e-{'9' * 10**6}\n", ends=(0, 2))


@in_table("recursion", "quotes in quotes, ten million")
def _(box: Box) -> Deed:
    return table_deed(box, 't,q:joint\n0,"' + '""' * 10**7 + '"\n')


# -- policies and runs ----------------------------------------------------------------------------

if TRAINING:
    from tests.security.surfaces.policy import PLAY, parts
    from tests.security.surfaces.policy import deed as policy_deed
    from tests.security.surfaces.run_folder import GOES_ON, RESUMED, newest, run

    in_policy, in_run = attacks_on("policy"), attacks_on("run folder")

    @in_policy("code", "statistics that are a pickle, without being asked for")
    def _(box: Box) -> Deed:
        policy_deed(box, parts())
        box.file("s.pkl", pickle.dumps(Harmful(box.owned)))
        return Deed(("play", "p.zip", "--statistics", "s.pkl", *PLAY))

    @in_policy("code", "statistics beside the policy by their usual name")
    def _(box: Box) -> Deed:
        box.file("vecnormalize.pkl", pickle.dumps(Harmful(box.owned)))
        return policy_deed(box, parts(), ends=(0,))

    @in_policy("code", "task of the folder in the options")
    def _(box: Box) -> Deed:
        box.file("mine.py", box.code)
        document = json.loads(parts()["dynx.json"])
        text = json.dumps(document).replace("CartPole-v1", "mine:CartPole-v1")
        return policy_deed(box, {**parts(), "dynx.json": text.encode()})

    @in_run("device", "checkpoints that are a pipe")
    def _(box: Box) -> Deed:
        folder = run(box)
        path = newest(folder)
        path.unlink()
        os.mkfifo(path)
        return GOES_ON

    @in_run("link", "weights of a checkpoint that lead outside")
    def _(box: Box) -> Deed:
        path = newest(run(box))
        path.unlink()
        path.symlink_to(box.outside / "secret.bin")
        return RESUMED

    @in_run("link", "run that is a link itself")
    def _(box: Box) -> Deed:
        folder = run(box)
        folder.rename(box.here / "real")
        folder.symlink_to("real")
        return GOES_ON

    @in_run("bomb", "ten thousand checkpoints that are none")
    def _(box: Box) -> Deed:
        folder = run(box)
        for k in range(10_000):
            (folder / "checkpoints" / f"{900 + k}.zip").write_bytes(b"PK")
        return GOES_ON

    @in_run("terminal", "names of checkpoints that are escape sequences")
    def _(box: Box) -> Deed:
        folder = run(box)
        for path in (folder / "checkpoints").glob("*.zip"):
            path.rename(path.with_name(f"9{CONTROLS}.zip"))
        return GOES_ON

    @in_run("type", "folders in the place of the checkpoints and of the curve")
    def _(box: Box) -> Deed:
        folder = run(box)
        for path in [*(folder / "checkpoints").glob("*"), *folder.glob("*.csv"), *folder.glob("*.jsonl")]:
            path.unlink()
            path.mkdir()
        return GOES_ON
