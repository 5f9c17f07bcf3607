"""Attacks by what `dynx world` reads of MJCF, and by what `dynx convert` and `same --fix` read and write."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

from tests.security.attack import Box, Deed, attacks_on
from tests.security.surfaces.description import HOSTILE, arm, mesh
from tests.security.surfaces.mjcf import mjcf
from tests.security.surfaces.scene import RUN

attack = attacks_on("mjcf")

FREE = '<body name="b"><freejoint/><geom size="0.1"/></body>'
STL = (
    "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 1\n"
    "endloop\nendfacet\nendsolid\n"
)


def run(box: Box, text: str, ends: tuple[int, ...] = (2,), *words: str) -> Deed:
    """Write a scene, which the victim runs."""
    return Deed(("world", box.file("m.xml", text), *RUN, *words), ends=ends)


def converted(box: Box, text: str, *words: str, out: str = "out.xml", name: str = "r.urdf") -> Deed:
    """Write a robot, which the victim converts."""
    return Deed(("convert", box.file(name, text), "-o", out, *words), ends=(0, 1, 2))


def mesh_of(file: str, name: str) -> str:
    """Return a scene with a mesh of a file and a name."""
    asset = f"<asset><mesh name={quoteattr(name)} file={quoteattr(file)} inertia='shell'/></asset>"
    geom = f"<geom type='mesh' mesh={quoteattr(name)}/>"
    return mjcf(
        f'<body name="b"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint/>{geom}</body>', asset
    )


@attack("path", "scene that includes a file outside")
def _(box: Box) -> Deed:
    return run(box, mjcf(FREE + '<include file="../outside/secret.urdf"/>'))


@attack("path", "scene with a height field and an image outside")
def _(box: Box) -> Deed:
    asset = f'<asset><hfield name="h" file="{box.outside}/secret.bin" size="1 1 1 1"/>'
    asset += f'<texture name="t" type="2d" file="{box.outside}/secret.bin"/></asset>'
    return run(box, mjcf('<geom type="hfield" hfield="h"/>' + FREE, asset), (0, 2))


@attack("path", "scene that is exported with a mesh outside")
def _(box: Box) -> Deed:
    text = mesh_of(f"{box.outside}/secret.stl", "a")
    return run(box, text, (0, 2), "--export", "out.toml")


@attack("path", "conversion of a mesh whose name climbs")
def _(box: Box) -> Deed:
    box.file("a.stl", STL)
    text = mesh_of("a.stl", "../../outside/owned")
    return converted(box, text, out="out.urdf", name="m.xml")


@attack("path", "conversion of meshes of one name in folders that climb")
def _(box: Box) -> Deed:
    for name in ("a/m.stl", "b/m.stl", "b/..\\..\\outside\\m.stl"):
        box.file(name, STL)
    shapes = "".join(
        map(mesh, ("a/m.stl", "b/../b/m.stl", "b/..\\..\\outside\\m.stl", "a/../../outside/secret.stl"))
    )
    return converted(box, arm(extra=shapes))


@attack("link", "folder of the converted meshes that leads outside")
def _(box: Box) -> Deed:
    box.file("m.stl", STL)
    (box.here / "out_assets").symlink_to(box.outside)
    return converted(box, arm(extra=mesh("m.stl")), "--overwrite")


@attack("link", "file of a converted mesh that leads outside")
def _(box: Box) -> Deed:
    box.file("secret.stl", STL)
    (box.here / "out_assets").mkdir()
    (box.here / "out_assets" / "secret.stl").symlink_to(box.outside / "secret.stl")
    (box.here / "out_assets" / "secret.obj").symlink_to(box.outside / "secret.obj")
    return converted(box, arm(extra=mesh("secret.stl")), "--overwrite")


@attack("link", "mended file whose includes lead outside")
def _(box: Box) -> Deed:
    (box.here / "a.xml").symlink_to(box.outside / "secret.urdf")
    box.file("m.xml", mjcf('<include file="a.xml"/>'))
    return Deed(("same", box.file("r.urdf", arm()), "m.xml", "--fix", "out.xml"))


@attack("bomb", "scene of copies without end")
def _(box: Box) -> Deed:
    return run(box, mjcf(f'<replicate count="9999" offset="1 0 0">{FREE * 20}</replicate>'))


@attack("bomb", "scene of bodies that all touch")
def _(box: Box) -> Deed:
    bodies = "".join(FREE.replace('"b"', f'"b{k}"') for k in range(20_000))
    return run(box, mjcf(bodies))


@attack("bomb", "scene with a height field without end")
def _(box: Box) -> Deed:
    asset = '<asset><hfield name="h" nrow="1000000" ncol="1000000" size="1 1 1 1"/></asset>'
    return run(box, mjcf('<geom type="hfield" hfield="h"/>' + FREE, asset), (0, 2))


@attack("bomb", "scene of keyframes without end")
def _(box: Box) -> Deed:
    keys = "".join(f'<key name="k{k}" qpos="0 0 1 1 0 0 0"/>' for k in range(200_000))
    return run(box, mjcf(FREE, after=f"<keyframe>{keys}</keyframe>"), (0, 2), "--keyframe", "k199999")


@attack("type", "keyframe of numbers that are none")
def _(box: Box) -> Deed:
    keys = '<keyframe><key name="k" qpos="nan 1e999 1 0 0 0 0" qvel="1"/></keyframe>'
    return run(box, mjcf(FREE, after=keys), (2,), "--keyframe", "k")


@attack("type", "step and solver of a scene that are none")
def _(box: Box) -> Deed:
    return run(
        box, mjcf(FREE, '<option timestep="-1e999" iterations="99999999999999999999" gravity="nan 0 0"/>')
    )


@attack("terminal", "keyframes, bodies and geoms that command a terminal")
def _(box: Box) -> Deed:
    keys = f'<keyframe><key name="{HOSTILE}" qpos="0 0 1 1 0 0 0"/></keyframe>'
    text = mjcf(FREE.replace('"b"', f'"{HOSTILE}"').replace("<geom", f'<geom name="g{HOSTILE}"'), after=keys)
    return run(box, text, (0, 2), "--keyframe", "no")


@attack("terminal", "robots that are compared whose names command a terminal")
def _(box: Box) -> Deed:
    box.file("n.urdf", arm(name="c", joint="j"))
    text = arm(joint="x").replace('"b"', f'"{HOSTILE}"').replace('"x"', f'"x{HOSTILE}"')
    other = box.file("r.urdf", text.replace('mass value="1"', 'mass value="2"'))
    return Deed(("same", other, "n.urdf"), ends=(0, 1, 2))


@attack("link", "files of several robots that lead outside")
def _(box: Box) -> Deed:
    for name in ("r", "s"):
        box.file(f"{name}.urdf", arm(extra='<collision><geometry><box size="1 1 1"/></geometry></collision>'))
    (box.here / "mended").mkdir()
    (box.here / "mended" / "r.urdf").symlink_to(box.outside / "secret.urdf")
    (box.here / "mended" / "s.urdf").symlink_to(box.outside / "new.urdf")
    return Deed(("doctor", "r.urdf", "s.urdf", "--samples", "1", "--fix", "mended"))


@attack("link", "files of several engines that lead outside")
def _(box: Box) -> Deed:
    box.file("m.xml", mjcf(FREE))
    (box.here / "out.mujoco.world").symlink_to(box.outside / "new")
    words = ("--engine", "mujoco,pybullet", "--duration", "0.002", "--quiet", "--save", "out.world")
    return Deed(("world", "m.xml", *words))


@attack("link", "files of several bodies that lead outside")
def _(box: Box) -> Deed:
    box.file("m.xml", mjcf(FREE + FREE.replace('"b"', '"c"').replace("<geom", '<geom pos="9 9 9"')))
    (box.here / "out.c.urdf").symlink_to(box.outside / "secret.urdf")
    return Deed(("world", "m.xml", "--engine", "mujoco", "--duration", "0.002", "--export", "out.urdf"))


def attaching(file: str, times: int = 1, inside: str = "") -> str:
    """Return a model to which one of a file is attached, some times."""
    attached = "".join(f'<attach model="s" body="b" prefix="p{k}_"/>' for k in range(times))
    asset = f'<asset><model name="s" file="{file}"/></asset>'
    return mjcf(f'<body name="b"><joint/><geom size="0.1"/>{attached}{inside}</body>', asset)


@attack("path", "models attached from outside by folders and links")
def _(box: Box) -> Deed:
    (box.outside / "secret.xml").write_text(mjcf(FREE.replace('"b"', '"TOP-SECRET-7719"')))
    (box.here / "a.xml").symlink_to(box.outside / "secret.xml")
    models = "".join(
        f'<model name="s{k}" file="{file}"/>'
        for k, file in enumerate(("a.xml", "../outside/secret.xml", f"{box.outside}/secret.xml"))
    )
    attached = "".join(f'<attach model="s{k}" prefix="p{k}"/>' for k in range(3))
    return run(box, mjcf(f'<body name="b">{attached}</body>', f"<asset>{models}</asset>"))


@attack("recursion", "models attached to each other")
def _(box: Box) -> Deed:
    box.file("a.xml", attaching("m.xml"))
    return run(box, attaching("a.xml"))


@attack("recursion", "model attached to itself")
def _(box: Box) -> Deed:
    return run(box, attaching("m.xml"))


@attack("recursion", "part of a model attached within itself")
def _(box: Box) -> Deed:
    return run(box, mjcf('<body name="b"><joint/><geom size="1"/><attach body="b" prefix="p"/></body>'))


@attack("bomb", "attached models that double")
def _(box: Box) -> Deed:
    for k in range(40):
        box.file(f"a{k}.xml", attaching(f"a{k + 1}.xml", 2) if k < 39 else mjcf(FREE))
    return run(box, attaching("a0.xml", 2))


@attack("bomb", "model of many bodies attached many times")
def _(box: Box) -> Deed:
    bodies = "".join(f'<body name="c{k}"><geom size="0.1"/></body>' for k in range(9_000))
    box.file("a.xml", mjcf(f'<body name="b">{bodies}</body>'))
    return run(box, attaching("a.xml", 5_000))


@attack("bomb", "part attached to itself that doubles")
def _(box: Box) -> Deed:
    parts = '<body name="a0"><geom size="0.1"/></body>'
    for k in range(1, 40):
        twice = "".join(f'<frame><attach body="a{k - 1}" prefix="{side}{k}_"/></frame>' for side in "xy")
        parts += f'<body name="a{k}">{twice}</body>'
    return run(box, mjcf(parts))
