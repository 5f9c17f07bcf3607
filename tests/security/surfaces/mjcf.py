"""Attacks by descriptions of robots in MJCF: `dynx info`, `agree`, and the look of their shapes."""

from __future__ import annotations

import os
from collections.abc import Callable
from xml.sax.saxutils import quoteattr

from tests.security.attack import Box, Deed, attacks_on, sparse
from tests.security.surfaces.description import HOSTILE

attack = attacks_on("mjcf")

BODY = '<body name="b"><joint name="j"/><geom size="0.1"/></body>'


def mjcf(world: str = BODY, before: str = "", after: str = "") -> str:
    """Return a model with these elements in its world, and before and after it."""
    return f'<mujoco model="m">{before}<worldbody>{world}</worldbody>{after}</mujoco>'


def info(box: Box, text: str | bytes, ends: tuple[int, ...] = (2,), name: str = "m.xml") -> Deed:
    """Write a model, which the victim reads."""
    return Deed(("info", box.file(name, text)), ends=ends)


def every_engine(box: Box, text: str, ends: tuple[int, ...] = (0, 1, 2)) -> Deed:
    """Write a model, which the victim loads, and with it every engine."""
    return Deed(("agree", box.file("m.xml", text)), ends=ends)


def seen(box: Box, text: str, ends: tuple[int, ...] = (0, 2)) -> Deed:
    """Write a model whose shapes the victim draws."""
    return Deed((box.file("m.xml", text),), "seen", ends)


def mesh(file: str, attributes: str = "") -> str:
    """Return a model with a mesh, from which the mass follows."""
    asset = f'<asset><mesh name="a" file={quoteattr(file)} {attributes}/></asset>'
    return mjcf('<body><joint/><geom type="mesh" mesh="a"/></body>', asset)


@attack("code", "modules beside the file")
def _(box: Box) -> Deed:
    for name in ("struct", "json", "numpy", "mujoco", "trimesh", "glfw", "sitecustomize"):
        box.file(f"{name}.py", box.code)
    return every_engine(box, mjcf(), (0,))


@attack("code", "plug-in of the engine beside the file")
def _(box: Box) -> Deed:
    box.file("libowned.so", b"\x7fELF" + bytes(64))
    return every_engine(box, mjcf(after='<extension><plugin plugin="libowned.so"/></extension>'))


@attack("path", "include of a file outside")
def _(box: Box) -> Deed:
    return info(box, mjcf(f'<include file="{box.outside}/secret.urdf"/>'))


@attack("path", "include that climbs")
def _(box: Box) -> Deed:
    return every_engine(box, mjcf('<include file="../outside/secret.urdf"/>'), (2,))


@attack("path", "include in an include that climbs")
def _(box: Box) -> Deed:
    box.file("sub/a.xml", '<mujocoinclude><include file="../../outside/secret.urdf"/></mujocoinclude>')
    return info(box, mjcf('<include file="sub/a.xml"/>'))


@attack("path", "model that is attached from outside")
def _(box: Box) -> Deed:
    asset = f'<asset><model name="s" file="{box.outside}/secret.urdf"/></asset>'
    return every_engine(box, mjcf(BODY + '<attach model="s" body="b" prefix="p"/>', asset))


@attack("bomb", "models that attach one another")
def _(box: Box) -> Deed:
    for name, other in (("a", "b"), ("b", "a")):
        asset = f'<asset><model name="m" file="{other}.xml"/></asset>'
        box.file(f"{name}.xml", mjcf(f'<attach model="m" prefix="{name}"/>', asset))
    asset = '<asset><model name="m" file="a.xml"/></asset>'
    return info(box, mjcf('<attach model="m" prefix="p"/>', asset))


@attack("bomb", "models of which each attaches the next one twice")
def _(box: Box) -> Deed:
    for k in range(40):
        asset = "".join(f'<model name="{side}" file="m{k + 1}.xml"/>' for side in "lr")
        both = "".join(f'<attach model="{side}" prefix="{side}"/>' for side in "lr")
        box.file(f"m{k}.xml", mjcf(both, f"<asset>{asset}</asset>"))
    box.file("m40.xml", mjcf())
    asset = '<asset><model name="m" file="m0.xml"/></asset>'
    return info(box, mjcf('<attach model="m" prefix="p"/>', asset))


@attack("bomb", "bodies of which each attaches the one before twice")
def _(box: Box) -> Deed:
    text = '<body name="b0"><geom size="0.1"/></body>'
    for k in range(1, 60):
        both = "".join(f'<attach body="b{k - 1}" prefix="{side}{k}"/>' for side in "lr")
        text += f'<body name="b{k}">{both}</body>'
    return info(box, mjcf(text))


@attack("path", "mesh outside")
def _(box: Box) -> Deed:
    return every_engine(box, mesh(f"{box.outside}/secret.stl"), (2,))


@attack("path", "mesh outside by the folder of meshes")
def _(box: Box) -> Deed:
    text = mesh("secret.obj").replace("<asset>", f'<compiler meshdir="{box.outside}"/><asset>')
    return every_engine(box, text, (2,))


@attack("path", "mesh outside by folders that climb")
def _(box: Box) -> Deed:
    return seen(box, mesh("secret.stl").replace("<asset>", '<compiler assetdir="../outside"/><asset>'))


@attack("path", "mesh outside by a package of Python")
def _(box: Box) -> Deed:
    box.file("__init__.py", "")
    return every_engine(box, mesh("../outside/secret.stl"), (2,))


@attack("path", "image outside")
def _(box: Box) -> Deed:
    asset = f'<asset><texture name="t" type="2d" file="{box.outside}/secret.bin"/>'
    asset += '<material name="m" texture="t"/></asset>'
    return seen(box, mjcf('<body><joint/><geom type="box" size="1 1 1" material="m"/></body>', asset))


@attack("path", "height field and skin outside")
def _(box: Box) -> Deed:
    asset = f'<asset><hfield name="h" file="{box.outside}/secret.bin" size="1 1 1 1"/>'
    asset += f'<skin name="s" file="{box.outside}/secret.bin"/></asset>'
    return every_engine(box, mjcf('<geom type="hfield" hfield="h"/>' + BODY, asset))


@attack("path", "entity that is a file")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE mujoco [<!ENTITY x SYSTEM "file://{box.outside}/secret.txt">]>'
    return every_engine(box, kind + mjcf().replace('"b"', '"&x;"'), (2,))


@attack("network", "mesh, include and image from elsewhere")
def _(box: Box) -> Deed:
    text = mesh("http://192.0.2.1/m.stl")
    return every_engine(box, text.replace("</asset>", '<texture file="http://192.0.2.1/i.png"/></asset>'))


@attack("network", "include from elsewhere")
def _(box: Box) -> Deed:
    return info(box, mjcf('<include file="http://192.0.2.1/a.xml"/>'))


@attack("link", "include that leads outside")
def _(box: Box) -> Deed:
    (box.here / "a.xml").symlink_to(box.outside / "secret.urdf")
    return info(box, mjcf('<include file="a.xml"/>'))


@attack("link", "mesh that leads outside")
def _(box: Box) -> Deed:
    (box.here / "m.stl").symlink_to(box.outside / "secret.stl")
    return every_engine(box, mesh("m.stl"), (2,))


@attack("link", "model that leads to an endless device")
def _(box: Box) -> Deed:
    (box.here / "m.xml").symlink_to("/dev/zero")
    return Deed(("info", "m.xml"))


@attack("device", "include of an endless device")
def _(box: Box) -> Deed:
    return info(box, mjcf('<include file="/dev/zero"/>'))


@attack("device", "include of a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "a.xml")
    return info(box, mjcf('<include file="a.xml"/>'))


@attack("device", "mesh that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "m.obj")
    return every_engine(box, mesh("m.obj"), (2,))


@attack("bomb", "entities that grow")
def _(box: Box) -> Deed:
    entities = "".join(f'<!ENTITY a{k} "' + 10 * f"&a{k - 1};" + '">' for k in range(1, 12))
    kind = f'<!DOCTYPE mujoco [<!ENTITY a0 "ha">{entities}]>'
    return every_engine(box, kind + mjcf().replace('"b"', '"&a11;"'), (2,))


@attack("bomb", "copies without end")
def _(box: Box) -> Deed:
    return info(box, mjcf(f'<replicate count="1000000000">{BODY}</replicate>'))


@attack("bomb", "copies of copies")
def _(box: Box) -> Deed:
    text = "<geom size='0.1'/>"
    for _ in range(12):
        text = f'<replicate count="100">{text}</replicate>'
    return info(box, mjcf(f"<body><joint/>{text}</body>"))


@attack("bomb", "includes that double")
def _(box: Box) -> Deed:
    for k in range(40):
        inside = f'<include file="a{k + 1}.xml"/>' * 2 if k < 39 else BODY
        box.file(f"a{k}.xml", f"<mujocoinclude>{inside}</mujocoinclude>")
    return info(box, mjcf('<include file="a0.xml"/>'))


@attack("bomb", "include of a large file")
def _(box: Box) -> Deed:
    sparse(box.here / "a.xml", 20 * 10**9, b"<mujocoinclude>")
    return info(box, mjcf('<include file="a.xml"/>'))


@attack("bomb", "bodies without end")
def _(box: Box) -> Deed:
    return info(box, mjcf("<body><joint/><geom size='1'/></body>" * 200_000))


@attack("bomb", "geoms without end")
def _(box: Box) -> Deed:
    return info(box, mjcf("<body><joint/>" + "<geom size='1'/>" * 10**6 + "</body>"), (0, 2))


@attack("bomb", "numbers without end")
def _(box: Box) -> Deed:
    return info(box, mjcf(BODY.replace('"0.1"', f'"{"1 " * 5_000_000}"')))


@attack("bomb", "meshes that are one large mesh")
def _(box: Box) -> Deed:
    sparse(box.here / "m.stl", 3 * 10**9, bytes(80) + (60_000_000).to_bytes(4, "little"))
    return every_engine(box, mesh("m.stl"), (2,))


@attack("bomb", "defaults without end")
def _(box: Box) -> Deed:
    classes = "".join(f'<default class="c{k}"><geom density="{k}"/>' for k in range(300))
    return info(box, mjcf(before=f"<default>{classes}{'</default>' * 300}</default>"), (0, 2))


@attack("recursion", "bodies in bodies")
def _(box: Box) -> Deed:
    return info(box, mjcf("<body><joint/><geom size='1'/>" * 100_000 + "</body>" * 100_000))


@attack("recursion", "frames in frames")
def _(box: Box) -> Deed:
    return info(box, mjcf("<frame pos='0 0 1'>" * 50_000 + BODY + "</frame>" * 50_000))


@attack("recursion", "include of itself")
def _(box: Box) -> Deed:
    return info(box, mjcf('<include file="m.xml"/>'))


@attack("recursion", "includes in a circle")
def _(box: Box) -> Deed:
    box.file("a.xml", '<mujocoinclude><include file="b.xml"/></mujocoinclude>')
    box.file("b.xml", '<mujocoinclude><include file="a.xml"/></mujocoinclude>')
    return info(box, mjcf('<include file="a.xml"/>'))


@attack("recursion", "classes of each other")
def _(box: Box) -> Deed:
    body = '<body childclass="a"><joint class="b"/><geom class="a" size="1"/></body>'
    inner = '<default class="a"><geom class="b"/></default><default class="b"><geom class="a"/></default>'
    return info(box, mjcf(body, f"<default>{inner}</default>"), (0, 2))


def _value(name: str, old: str, new: str) -> Callable[[Box], Deed]:
    def prepare(box: Box) -> Deed:
        text = mjcf('<body name="b" pos="1 2 3"><joint axis="0 1 0"/><geom size="0.1" mass="1"/></body>')
        assert old in text
        return info(box, text.replace(old, new))

    prepare.__name__ = name
    return prepare


for _name, _old, _new in (
    ("position that is not finite", 'pos="1 2 3"', 'pos="nan inf 1e999"'),
    ("mass that is negative", 'mass="1"', 'mass="-1"'),
    ("mass beyond every bound", 'mass="1"', 'mass="1e300"'),
    ("axis of zero", 'axis="0 1 0"', 'axis="0 0 0"'),
    ("size of text", 'size="0.1"', 'size="%s%n{0}"'),
    ("rotation of zero", 'pos="1 2 3"', 'quat="0 0 0 0"'),
    ("two rotations", 'pos="1 2 3"', 'quat="1 0 0 0" euler="1 2 3"'),
    ("kind that does not exist", "<joint ", '<joint type="__class__" '),
    ("no element at all", "<joint", "<\x00joint"),
):
    attack("type", _name)(_value(_name, _old, _new))


@attack("type", "text in another encoding")
def _(box: Box) -> Deed:
    head = b'<?xml version="1.0" encoding="utf-7"?>'
    return info(box, head + mjcf().encode("utf-16"))


@attack("html", "names that are elements of a page")
def _(box: Box) -> Deed:
    name = quoteattr("</script><script>fetch('http://192.0.2.1')</script>")
    return seen(box, mjcf(BODY.replace('"b"', name)))


@attack("terminal", "names that command a terminal")
def _(box: Box) -> Deed:
    text = mjcf(f'<body name="{HOSTILE}"><joint name="x{HOSTILE}"/><geom size="0.1"/></body>')
    return info(box, text, (0, 2))


@attack("terminal", "unknown elements and attributes that command a terminal")
def _(box: Box) -> Deed:
    return info(box, mjcf(BODY.replace("<joint", f'<joint \u202e="{HOSTILE}"')))


@attack("printf", "names that are formats")
def _(box: Box) -> Deed:
    return every_engine(box, mjcf(BODY.replace('"b"', '"%n%s{0.__class__}%(x)s"')))
