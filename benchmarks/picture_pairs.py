"""Twelve subjects drawn by dynx and by other libraries, as pairs for readers who do not know which is which.

``xvfb-run -a -s "-screen 0 2304x1728x24" python -m benchmarks.picture_pairs --out FOLDER --key FILE`` draws
arm, a humanoid, a quadruped on a height field, a stack, a lander, a cart-pole, a gripper, R2D2, contacts,
inertia ellipsoids, frames and two engines: by dynx, and where they can by PyBullet (its software renderer,
and its window), MuJoCo (by software) and a plain page of viser; the same parts, view and size. FOLDER gets
``NNN.png``, two pictures beside each other with the sides drawn by ``--seed``, ``single_NN.png``, a picture
of dynx alone, ``sheet.png``, all of them, and ``QUESTIONS.md``. FILE says which side is whose.

Single pictures stay in the folder ``--drawn``; those that are there are not drawn again. ``--votes FILES``
with ``--key FILE`` counts what readers wrote, one file each, in lines such as ``001 A it is clear what
moves``. It needs the extras ``viewer`` and ``world``, PyBullet, MuJoCo, Chromium and playwright.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

import dynx
from benchmarks.libraries.picture_peers import (
    Arrow,
    Standing,
    Subject,
    Undrawable,
    ViserPages,
    draw_by_mujoco,
    draw_by_tiny_renderer,
    draw_in_bullet_window,
)
from dynx.model.geometry import HeightField, Plane
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera, DrawnShape
from dynx.viewer import Viewer
from dynx.viewer.drawn_robot import size_of
from dynx.viewer.export import CLEAR_SKY_BLUE, shapes_of, stage_for
from dynx.world import Material, Scene, SceneBody, World, read_scene
from dynx.world.comparison import compare_engines

WIDE, SMALL = (1280, 960), (400, 300)
"""Width and height of the pictures [pixels]."""

SIDE = (776, 582)
"""Width and height of a side of a pair of large pictures, so that both are seen at once [pixels]."""

LEAST, LEAST_EACH = 0.6, 0.4
"""Least share of the votes for dynx against each library, and for each picture."""

Rgb = NDArray[np.uint8]


class Shown(NamedTuple):
    """What dynx shows, and what other libraries need to show it, too."""

    viewer: Viewer
    direction: tuple[float, float, float] | None = None
    """From where it is seen; None for the usual view."""
    camera: Camera | None = None
    """Camera that sees a part of it closely; None for one that sees all."""
    opacity: float = 1.0
    """Opacity of its parts."""
    arrows: tuple[Arrow, ...] = ()
    standing: Standing | None = None
    frames: tuple[Floats, ...] = ()
    inertias: tuple[Any, ...] = ()


Open = Callable[[ExitStack, bool], Shown]
"""Function of a stack, which closes what it opens, and of whether the picture is dark."""

PICTURES: dict[str, Open] = {}


def picture(open_subject: Open) -> Open:
    """Add a subject."""
    PICTURES[open_subject.__name__] = open_subject
    return open_subject


@picture
def arm(stack: ExitStack, dark: bool) -> Shown:
    """Show a UR5."""
    q = [0.6, -1.2, 1.6, -2.0, -1.57, 0.3]
    return Shown(stack.enter_context(dynx.load("ur5").view(q=q, dark=dark, whole_meshes=True)))


@picture
def humanoid(stack: ExitStack, dark: bool) -> Shown:
    """Show Unitree's G1."""
    model = dynx.load("g1", base="floating")
    q = model.neutral()
    angles = {"left_shoulder_roll_joint": 0.5, "right_shoulder_roll_joint": -0.5}
    angles |= {"left_elbow_joint": 0.2, "right_elbow_joint": 0.2, "left_knee_joint": 0.4}
    angles |= {"right_knee_joint": 0.4, "left_hip_pitch_joint": -0.2, "right_hip_pitch_joint": -0.2}
    for joint, angle in angles.items():
        q[7 + model.joint_names.index(joint)] = angle
    viewer = stack.enter_context(model.view(q=q, dark=dark, whole_meshes=True))
    return Shown(viewer, (1.0, -0.55, 0.25))


@picture
def quadruped(stack: ExitStack, dark: bool) -> Shown:
    """Show Unitree's A1 on hills."""
    x, y = np.meshgrid(np.linspace(-2.0, 2.0, 81), np.linspace(-2.0, 2.0, 81))
    steep = 0.035 + 0.1 * np.clip(np.hypot(x, y) - 0.35, 0.0, 1.0)
    heights = steep * np.sin(4.0 * x + 0.5) * np.cos(3.6 * y)
    hills = SceneBody(
        "hills",
        HeightField(tuple(map(tuple, heights.tolist())), (4.0, 4.0)),
        material=Material(friction=0.9, rgba=(0.47, 0.56, 0.36, 1.0)),
    )
    world = World(Scene("hills", bodies=[hills], robots=read_scene("standing").robots), "mujoco")
    viewer = _world(stack, world, 700, dark)
    return Shown(viewer, (1.0, -1.0, 0.45))


@picture
def stack_of_boxes(stack: ExitStack, dark: bool) -> Shown:
    """Show boxes that settle."""
    return Shown(_world(stack, World(read_scene("stack"), "mujoco"), 300, dark))


@picture
def lander(stack: ExitStack, dark: bool) -> Shown:
    """Show a lander above its pad."""
    return Shown(_world(stack, World(read_scene("landing"), "mujoco"), 1, dark), (0.5, -1.0, 0.3))


@picture
def cart_pole(stack: ExitStack, dark: bool) -> Shown:
    """Show a cart with a pole that leans."""
    viewer = dynx.load("cart_pole").view(q=[-0.3, 0.35], dark=dark, whole_meshes=True)
    return Shown(stack.enter_context(viewer), (0.3, -1.0, 0.28))


@picture
def gripper(stack: ExitStack, dark: bool) -> Shown:
    """Show the hand of a Panda that lifts a cube."""
    viewer = _world(stack, World(read_scene("lifting"), "mujoco"), 1200, dark)
    return Shown(viewer, camera=Camera.look_at((0.88, -0.36, 0.24), (0.5, 0.0, 0.16), size=WIDE))


@picture
def r2d2(stack: ExitStack, dark: bool) -> Shown:
    """Show R2D2 of PyBullet."""
    import pybullet_data

    model = dynx.load(Path(pybullet_data.getDataPath(), "r2d2.urdf"))
    return Shown(stack.enter_context(model.view(dark=dark, whole_meshes=True)), (0.75, -1.0, 0.4))


@picture
def contacts(stack: ExitStack, dark: bool) -> Shown:
    """Show the forces on the feet of an A1 that stands."""
    world = World(read_scene("standing"), "mujoco")
    viewer = _world(stack, world, 1500, dark)
    viewer.set_shown("contact forces")
    viewer.set_shown("force numbers")
    arrows = tuple(Arrow(np.array(c.point), -np.array(c.force)) for c in world.contacts())
    if arrows and arrows[0].force[2] < 0.0:
        arrows = tuple(Arrow(each.point, -each.force) for each in arrows)
    model, state = world.scene.robots[0].model, world.state.robots["a1"]
    masses, middles = [], []
    for link, T in link_poses(model, np.array(state.q)):
        inertial = model.inertial(link)
        masses.append(inertial.mass)
        middles.append((T @ inertial.origin.matrix)[:3, 3])
    middle = np.average(middles, axis=0, weights=masses)
    feet = np.array([each.point + np.array([0.0, 0.0, 0.02]) for each in arrows])
    return Shown(viewer, arrows=arrows, standing=Standing(sum(masses), middle, feet, 0.02))


@picture
def inertia_ellipsoids(stack: ExitStack, dark: bool) -> Shown:
    """Show the inertia of the links of a Solo."""
    model = dynx.load("solo12", base="floating")
    q = np.concatenate([model.neutral()[:7], np.tile([0.0, 0.7, -1.4], 4)])
    viewer = stack.enter_context(model.view(q=q, dark=dark, whole_meshes=True))
    viewer.set_shown("inertia ellipsoids")
    found = [(model.inertial(link), T) for link, T in link_poses(model, q)]
    return Shown(viewer, inertias=tuple(each for each in found if each[0].mass > 0.0))


@picture
def frames(stack: ExitStack, dark: bool) -> Shown:
    """Show the frames of the links of a Panda."""
    model, q = dynx.load("panda"), [0, -0.5, 0, -2.1, 0, 1.6, 0.8, 0.02]
    viewer = stack.enter_context(model.view(q=q, dark=dark, whole_meshes=True))
    viewer.set_shown("frames")
    opacity = 0.5
    viewer.set_opacity(opacity)
    poses = tuple(T for _, T in link_poses(model, np.array(q, dtype=np.float64)))
    return Shown(viewer, opacity=opacity, frames=poses)


@picture
def two_engines(stack: ExitStack, dark: bool) -> Shown:
    """Show one shot in PyBullet and, see-through, in MuJoCo."""
    run = compare_engines(read_scene("bowling"), ["pybullet", "mujoco"], duration=1.2, samples=60)
    viewer = stack.enter_context(Viewer(run, port=0, dark=dark))
    viewer.view.go_to(0.45)
    return Shown(viewer, (-0.7, -1.0, 0.7))


def _world(stack: ExitStack, world: World, steps: int, dark: bool) -> Viewer:
    stack.enter_context(world)
    world.step(steps)
    viewer: Viewer = stack.enter_context(world.view(steps=False, dark=dark, whole_meshes=True))
    viewer.set_shown("contact forces", False)
    return viewer


def subject_of(shown: Shown, size: tuple[int, int]) -> Subject:
    """Return what other libraries draw in a size: what the viewer shows, without what only dynx adds."""
    viewer, shapes, floor = shown.viewer, [], None
    motions = viewer.view.motions
    for number, motion in enumerate(motions):
        poses = motion.at(motion.frame_at(viewer.view.time))
        for part, shape, rgba, T in shapes_of(motion):
            pose = poses.get(part, np.eye(4)) @ T
            if isinstance(shape, Plane):
                floor = float(pose[2, 3])
            elif number == 0:
                colour = (rgba[0], rgba[1], rgba[2], rgba[3] * shown.opacity)
                shapes.append(DrawnShape(0, shape, colour, pose))
            elif part in poses:
                shapes.append(DrawnShape(0, shape, CLEAR_SKY_BLUE, pose))
    stage = _stage(shown, size)
    length, axis = 0.0, 0.0
    if shown.arrows:
        length = 0.2 / max(float(np.linalg.norm(each.force)) for each in shown.arrows)
    if shown.frames:
        axis = 0.1 * size_of(motions[0].robots[motions[0].name])
    return Subject(
        tuple(shapes),
        stage.camera,
        floor if stage.floor is None else stage.floor,
        shown.arrows,
        shown.standing,
        length,
        shown.frames,
        axis,
        shown.inertias,
    )


def _stage(shown: Shown, size: tuple[int, int]) -> Any:
    if shown.camera is not None:
        view = Camera(shown.camera.pose, shown.camera.field_of_view, size)
        return stage_for(shown.viewer.view.motions[0], size, camera=view)
    first, *others = shown.viewer.view.motions
    towards: dict[str, Any] = {"time": shown.viewer.view.time, "ghost": next(iter(others), None)}
    if shown.direction is not None:
        towards["direction"] = np.array(shown.direction) / np.linalg.norm(shown.direction)
    return stage_for(first, size, **towards)


# Drawing.


Draw = Callable[[Subject, bool], Rgb]


class Look(NamedTuple):
    """Size and light of a picture."""

    size: tuple[int, int] = WIDE
    dark: bool = False

    def file(self, name: str, library: str) -> str:
        """Return the name of the file of a picture."""
        return f"{name}-{library}-{self.size[0]}{'-dark' if self.dark else ''}.png"


def peers_in(look: Look, name: str, peers: Sequence[str]) -> list[str]:
    """Return the libraries that draw a subject: viser alone is dark, too, and small pictures are drawn by one
    library for each subject, in turn."""
    if look.dark:
        return [each for each in peers if each == "viser"]
    return [peers[list(PICTURES).index(name) % len(peers)]] if look.size == SMALL else list(peers)


def draw_all(names: Sequence[str], peers: Mapping[str, Draw], look: Look, folder: Path) -> None:
    """Draw pictures that the folder does not have, by dynx and by each of the peers that can."""
    for name in names:
        wanted = {
            library: folder / look.file(name, library)
            for library in ("dynx", *peers_in(look, name, list(peers)))
        }
        missing = {library: path for library, path in wanted.items() if not path.exists()}
        if not missing:
            continue
        with ExitStack() as stack:
            shown = PICTURES[name](stack, look.dark)
            subject = subject_of(shown, look.size)
            for library, path in missing.items():
                if library == "dynx":
                    shown.viewer.export(path, camera=subject.camera)
                    continue
                try:
                    rgb = peers[library](subject, look.dark)
                except Undrawable as reason:
                    print(f"{path.stem}: {reason}", flush=True)
                    continue
                Image.fromarray(rgb).save(path)
                print(path.name, flush=True)


# Pairs.


class Pair(NamedTuple):
    """Two pictures of one subject."""

    picture: str
    peer: str
    look: Look


def pairs_in(folder: Path, names: Sequence[str], peers: Sequence[str], looks: Sequence[Look]) -> list[Pair]:
    """Return the pairs of pictures that a folder has."""
    return [
        Pair(name, peer, look)
        for look in looks
        for name in names
        for peer in peers
        if all((folder / look.file(name, each)).exists() for each in ("dynx", peer))
    ]


def beside(left: Path, right: Path) -> Image.Image:
    """Return two pictures beside each other, with the letters A and B above."""
    sides = [Image.open(each).convert("RGB") for each in (left, right)]
    if sides[0].width > SIDE[0]:
        sides = [each.resize(SIDE, Image.Resampling.LANCZOS) for each in sides]
    (width, height), gap, top = sides[0].size, 12, 30
    sheet = Image.new("RGB", (2 * width + gap, height + top), (128, 128, 128))
    write = ImageDraw.Draw(sheet)
    for k, (side, letter) in enumerate(zip(sides, "AB", strict=True)):
        sheet.paste(side, (k * (width + gap), top))
        place = (k * (width + gap) + width // 2, 3)
        write.text(place, letter, fill=(255, 255, 255), font=ImageFont.load_default(22))
    return sheet


QUESTIONS = """# Pictures

Look at each picture yourself, in any order, and write your answers into a file of your own. Do not talk to
other readers, and read nothing else about these pictures.

## Pairs

Each of {pairs} shows one subject twice, A left and B right. **Which picture would you rather look at; which
says better what is going on?** Choose one even if it is close. Write a line for each: number, letter, and one
sentence why, such as

    001 A the arm stands out from the ground and its joints are clear

## Single pictures

For each of {singles}: **what is it, what moves or acts, and how large is it** (in metres or centimetres,
as far as the picture says)? Write a line for each:

    single_01 a robot arm; its six joints turn; about 1 m high

`sheet.png` has all of them at once.
"""


def write_pairs(out: Path, key: Path, drawn: Path, pairs: Sequence[Pair], seed: int) -> None:
    """Write pairs in random order, single pictures, questions, and the key."""
    out.mkdir(parents=True, exist_ok=True)
    rng = random.Random(seed)
    order = list(pairs)
    rng.shuffle(order)
    table: dict[str, dict[str, Any]] = {}
    for number, (name, peer, look) in enumerate(order, 1):
        libraries = ["dynx", peer]
        rng.shuffle(libraries)
        beside(*(drawn / look.file(name, each) for each in libraries)).save(out / f"{number:03}.png")
        sides = dict(zip("AB", libraries, strict=True))
        table[f"{number:03}"] = {
            "picture": name, "peer": peer, "width": look.size[0], "dark": look.dark, **sides
        }  # fmt: skip
    names = [each for each in PICTURES if (drawn / Look().file(each, "dynx")).exists()]
    rng.shuffle(names)
    singles = []
    for number, name in enumerate(names, 1):
        single = Image.open(drawn / Look().file(name, "dynx")).convert("RGB")
        single.save(out / f"single_{number:02}.png")
        singles.append(single.resize(SMALL, Image.Resampling.LANCZOS))
        table[f"single_{number:02}"] = {"picture": name}
    sheet = Image.new("RGB", (4 * SMALL[0], -(-len(singles) // 4) * SMALL[1]))
    for k, single in enumerate(singles):
        sheet.paste(single, (k % 4 * SMALL[0], k // 4 * SMALL[1]))
    sheet.save(out / "sheet.png")
    texts = {"pairs": f"001.png to {len(order):03}.png", "singles": f"single_01.png to {sheet_end(singles)}"}
    (out / "QUESTIONS.md").write_text(QUESTIONS.format(**texts), encoding="utf-8")
    key.write_text(json.dumps(table, indent=1), encoding="utf-8")
    print(f"{len(order)} pairs and {len(singles)} single pictures in {out}; the key is {key}")


def sheet_end(singles: Sequence[Image.Image]) -> str:
    """Return the name of the last single picture."""
    return f"single_{len(singles):02}.png"


# Votes.


class Vote(NamedTuple):
    """The choice of a reader."""

    pair: str
    side: str
    reason: str


def votes_in(text: str) -> Iterator[Vote]:
    """Yield the votes in the answers of a reader; other lines are passed over."""
    for line in text.splitlines():
        found = re.match(r"\W*(\d{3})(?:\.png)?\W+([AB])\b\W*(.*)", line.strip())
        if found:
            yield Vote(*found.groups())


def count_votes(key: Mapping[str, Mapping[str, Any]], files: Sequence[Path]) -> bool:
    """Print the share of the votes for dynx by library and by picture, and all reasons of votes against it;
    return whether the bars are met. Raises SystemExit for a vote on an unknown pair, and for a reader who
    left a pair out or voted twice."""
    pairs = {name for name, each in key.items() if "peer" in each}
    won: dict[tuple[str, str], Counter[bool]] = defaultdict(Counter)
    against = []
    for file in files:
        votes = list(votes_in(file.read_text(encoding="utf-8")))
        given = Counter(each.pair for each in votes)
        wrong = sorted((pairs ^ given.keys()) | {pair for pair, count in given.items() if count > 1})
        if wrong:
            raise SystemExit(f"{file.name}: {', '.join(wrong)}: wanted one vote for each pair of the key")
        for vote in votes:
            pair = key[vote.pair]
            for_dynx = pair[vote.side] == "dynx"
            shade = "dark" if pair["dark"] else "light"
            for group in (
                ("library", pair["peer"]),
                ("picture", pair["picture"]),
                ("look", f"{pair['width']} pixels, {shade}"),
                ("all", "all"),
            ):
                won[group][for_dynx] += 1
            if not for_dynx:
                against.append(f"{pair['picture']}, {pair['peer']}, {vote.pair}: {vote.reason}")
    good = True
    for (kind, name), counts in sorted(won.items()):
        share = counts[True] / counts.total()
        bar = {"library": LEAST, "picture": LEAST_EACH}.get(kind, 0.0)
        good &= share >= bar
        text = f"{kind} {name}: {100.0 * share:.0f} % of {counts.total()} votes"
        print(text + ("" if share >= bar else f", less than {100.0 * bar:.0f} %"))
    print("\nVotes for another picture:", *sorted(against), sep="\n")
    return good


def main() -> None:
    """Draw pairs, or count votes and end with an error where a bar is missed."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    options.add_argument("--out", type=Path, help="folder of the pairs")
    options.add_argument("--key", type=Path, required=True, help="file that says which side is whose")
    options.add_argument("--drawn", type=Path, help="folder of single pictures, which are not drawn again")
    options.add_argument("--picture", default=",".join(PICTURES), help="subjects, between commas")
    options.add_argument("--peer", default="tiny,window,mujoco,viser", help="libraries, between commas")
    options.add_argument("--seed", type=int, default=0, help="seed of sides and order")
    options.add_argument("--light-only", action="store_true", help="no dark and no small pictures")
    options.add_argument("--votes", type=Path, nargs="+", help="answers of readers, a file each")
    given = options.parse_args()
    if given.votes:
        if not count_votes(json.loads(given.key.read_text(encoding="utf-8")), given.votes):
            raise SystemExit(1)
        return
    if given.out is None:
        options.error("wanted --out, or --votes")
    drawn = given.drawn or Path(tempfile.mkdtemp())
    drawn.mkdir(parents=True, exist_ok=True)
    looks = [Look()] if given.light_only else [Look(), Look(dark=True), Look(SMALL)]
    names, chosen = given.picture.split(","), given.peer.split(",")
    # MuJoCo chooses when it is imported, which an engine of dynx may do before it draws.
    os.environ.setdefault("MUJOCO_GL", "osmesa")
    with ViserPages() as pages:
        draw: dict[str, Draw] = {
            "tiny": draw_by_tiny_renderer,
            "window": draw_in_bullet_window,
            "mujoco": draw_by_mujoco,
            "viser": pages.draw,
        }
        for look in looks:
            draw_all(names, {each: draw[each] for each in chosen}, look, drawn)
    write_pairs(given.out, given.key, drawn, pairs_in(drawn, names, chosen, looks), given.seed)


if __name__ == "__main__":
    main()
