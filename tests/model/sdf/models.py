"""Random robots in SDF, written from the format's specification."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from hypothesis import strategies as st

from tests.model.random_numbers import Draw, direction, lengths, vector

angles = st.floats(-3.0, 3.0).map(lambda x: round(x, 2))
degrees = st.floats(-170.0, 170.0).map(lambda x: round(x, 1))


@st.composite
def quaternions(draw: Draw) -> str:
    """Text of a quaternion of length 1; what another one means, each reader decides by itself."""
    entries = np.array(draw(direction(4)).split(), float)
    return " ".join(map(str, entries / np.linalg.norm(entries)))


@dataclass
class Names:
    """Names that are made, and those of frames that a pose may be stated in."""

    counts: dict[str, int] = field(default_factory=dict)

    def new(self, kind: str) -> str:
        self.counts[kind] = self.counts.get(kind, 0) + 1
        return f"{kind}{self.counts[kind]}"


@st.composite
def poses(draw: Draw, frames: list[str], *, new: bool = True) -> str:
    """A ``<pose>``, or nothing; one of version 1.9 or later may have any form of rotation."""
    if draw(st.integers(0, 3)) == 0:
        return ""
    relative = f' relative_to="{draw(st.sampled_from(frames))}"' if frames and draw(st.booleans()) else ""
    form = draw(st.sampled_from(["rpy", "degrees", "quaternion"])) if new else "rpy"
    position = draw(vector(3))
    if form == "degrees":
        return f'<pose degrees="true"{relative}>{position} {draw(vector(3, degrees))}</pose>'
    if form == "quaternion":
        return f'<pose rotation_format="quat_xyzw"{relative}>{position}  {draw(quaternions())}</pose>'
    return f"<pose{relative}>{position} {draw(vector(3, angles))}</pose>"


@st.composite
def shapes(draw: Draw, name: str) -> str:
    kind = draw(st.sampled_from(["box", "sphere", "cylinder", "capsule", "ellipsoid"]))
    sizes = {
        "box": "<size>{0} {1} {2}</size>",
        "ellipsoid": "<radii>{0} {1} {2}</radii>",
        "sphere": "<radius>{0}</radius>",
    }.get(kind, "<radius>{0}</radius><length>{1}</length>")
    size = sizes.format(*(draw(lengths) for _ in range(3)))
    density = f"<density>{draw(st.integers(100, 3000))}</density>" if draw(st.booleans()) else ""
    return (
        f'<collision name="{name}">{draw(poses([]))}{density}'
        f"<geometry><{kind}>{size}</{kind}></geometry></collision>"
    )


@st.composite
def inertials(draw: Draw, *, new: bool = True) -> str:
    """An ``<inertial>``, with shapes where the inertia follows from them; or nothing."""
    kind = draw(st.sampled_from(["none", "stated", "auto" if new else "stated"]))
    if kind == "none":
        return ""
    if kind == "auto":
        density = f"<density>{draw(st.integers(100, 3000))}</density>" if draw(st.booleans()) else ""
        found = "".join(draw(shapes(f"c{k}")) for k in range(draw(st.integers(1, 3))))
        return f'<inertial auto="true">{density}</inertial>{found}'
    pose = draw(poses([], new=new))
    tensor = "<ixx>0.3</ixx><iyy>0.4</iyy><izz>0.5</izz><ixy>0.01</ixy><ixz>-0.02</ixz><iyz>0.03</iyz>"
    inertia = draw(st.sampled_from(["", f"<inertia>{tensor}</inertia>", "<inertia><ixy>0.1</ixy></inertia>"]))
    mass = draw(st.sampled_from(["", "<mass>2.5</mass>"]))
    return f"<inertial>{pose}{mass}{inertia}</inertial>"


@st.composite
def joints(
    draw: Draw, name: str, parent: str, child: str, frames: list[str], *, kinds: list[str], old: str
) -> str:
    """A joint; `old` is what its axes say of the frame of the model, for versions before 1.7."""
    kind = draw(st.sampled_from(kinds))
    pose = draw(poses([] if old else frames, new=not old))

    def axis(tag: str, xyz: str) -> str:
        expressed = (
            f' expressed_in="{draw(st.sampled_from(frames))}"'
            if not old and kind != "universal" and draw(st.booleans())
            else ""
        )
        limit = draw(st.sampled_from(["", "<limit><lower>-0.5</lower><upper>0.75</upper></limit>"]))
        dynamics = draw(
            st.sampled_from(["", "<dynamics><damping>0.3</damping><friction>0.1</friction></dynamics>"])
        )
        return f"<{tag}><xyz{expressed}>{xyz}</xyz>{old}{limit}{dynamics}</{tag}>"

    axes = ""
    if kind == "universal":
        first, second = draw(st.permutations(["1 0 0", "0 1 0", "0 0 1"]))[:2]
        axes = axis("axis", first) + axis("axis2", second)
    elif kind != "fixed":
        axes = axis("axis", draw(direction()))
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f'<joint name="{name}" type="{kind}">{pose}{ends}{axes}</joint>'


@st.composite
def models(draw: Draw) -> str:
    """A robot of version 1.9 or later, free or fixed in the world, with frames and nested models."""
    names, frames = Names(), ["__model__"]
    links: list[str] = []
    parts: list[str] = []
    # Drake turns no universal joint round.
    turned = draw(st.booleans())
    kinds = ["revolute", "continuous", "prismatic", "fixed", *([] if turned else ["universal"])]
    for _ in range(draw(st.integers(1, 5))):
        choice = draw(st.sampled_from(["link", "link", "frame", "nested"]))
        if choice == "frame" and links:
            name = names.new("f")
            attached = f' attached_to="{draw(st.sampled_from(frames))}"' if draw(st.booleans()) else ""
            parts.append(f'<frame name="{name}"{attached}>{draw(poses(frames))}</frame>')
            frames.append(name)
            continue
        if choice == "nested":
            model, inner = names.new("n"), names.new("l")
            frame = draw(poses([inner, "__model__"]))
            placement = draw(st.sampled_from(["", ' placement_frame="g"', f' placement_frame="{inner}"']))
            parts.append(
                f'<model name="{model}"{placement}>{draw(poses(frames))}'
                f'<link name="{inner}">{draw(poses([]))}{draw(inertials())}</link>'
                f'<frame name="g">{frame}</frame></model>'
            )
            new = f"{model}::{inner}"
            frames += [new, model, f"{model}::g"]
        else:
            new = names.new("l")
            parts.append(f'<link name="{new}">{draw(poses(frames))}{draw(inertials())}</link>')
            frames.append(new)
        if links:
            joint, parent = names.new("j"), draw(st.sampled_from(links))
            parts.append(draw(joints(joint, parent, new, frames, kinds=kinds, old="")))
            frames.append(joint)
        links.append(new)
    if not links:
        parts.append('<link name="only"/>')
        links.append("only")
    if draw(st.booleans()):
        on = draw(st.sampled_from(links if turned else links[:1]))
        parts.append(draw(joints("w", "world", on, frames, kinds=kinds, old="")))
    order = draw(st.permutations(parts))
    version = draw(st.sampled_from(["1.9", "1.10", "1.11"]))
    content = draw(poses([])) + "<static>false</static>" + "".join(order)
    return f'<sdf version="{version}"><model name="robot">{content}</model></sdf>'


@st.composite
def old_models(draw: Draw) -> str:
    """A robot of versions 1.4 to 1.6, where axes may be stated in the frame of the model."""
    version = draw(st.sampled_from(["1.4", "1.5", "1.6"]))
    links: list[str] = []
    parts: list[str] = []
    for k in range(draw(st.integers(1, 4))):
        name = f"l{k}"
        parts.append(f'<link name="{name}">{draw(poses([], new=False))}{draw(inertials(new=False))}</link>')
        if links:
            flag = draw(st.sampled_from(["", "<use_parent_model_frame>1</use_parent_model_frame>"]))
            old = " " if version == "1.4" else flag or " "
            kinds = ["revolute", "prismatic"]
            joint = joints(f"j{k}", draw(st.sampled_from(links)), name, [], kinds=kinds, old=old)
            parts.append(draw(joint))
        links.append(name)
    content = draw(poses([], new=False)) + "".join(parts)
    return f'<sdf version="{version}"><model name="robot">{content}</model></sdf>'
