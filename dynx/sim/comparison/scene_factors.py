"""Differences of two scenes as plants: engine with settings, bodies, robots, and the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from typing import Any

from dynx.model import Model
from dynx.model.geometry.links import Collision
from dynx.sim.comparison.words import words, words_apart
from dynx.sim.plants.scene_plant import ScenePlant

Edit = Callable[[ScenePlant], ScenePlant]
"""Function that takes a difference over into a plant."""

PARTS = ("bodies", "robots")


def divisible(ours: Any, theirs: Any) -> bool:
    """Return True for two plants of scenes whose bodies and robots have the same names."""
    if not (isinstance(ours, ScenePlant) and isinstance(theirs, ScenePlant)):
        return False
    names = [
        [each.robot, *([part.name for part in getattr(each.scene, kind)] for kind in PARTS)]
        for each in (ours, theirs)
    ]
    return names[0] == names[1]


def scene_factors(ours: ScenePlant, theirs: ScenePlant) -> Iterator[tuple[str, tuple[str, str], Edit]]:
    """Yield the name, the values in words, and the edit of each difference of two plants that are divisible.

    The model of the simulated robot is that of the scenario, and not among them; its shapes are, because
    models that differ in them alone are equal.
    """
    if ours.engine != theirs.engine:
        both = (_engine(ours), _engine(theirs))
        yield (
            "plant.engine",
            both,
            lambda plant: replace(plant, engine=theirs.engine, settings=theirs.settings),
        )
    elif ours.settings != theirs.settings:
        both = (str(dict(ours.settings)), str(dict(theirs.settings)))
        yield "plant.settings", both, lambda plant: replace(plant, settings=theirs.settings)
    if ours.joint_limits != theirs.joint_limits:
        both = (str(ours.joint_limits), str(theirs.joint_limits))
        yield "plant.joint_limits", both, lambda plant: replace(plant, joint_limits=theirs.joint_limits)
    for kind in PARTS:
        for k, (one, other) in enumerate(
            zip(getattr(ours.scene, kind), getattr(theirs.scene, kind), strict=True)
        ):
            own = kind == "robots" and one.name == ours.robot
            for each in fields(one):
                mine, its = getattr(one, each.name), getattr(other, each.name)
                if each.name == "model" and _same_links(mine, its) and _shapes(mine) != _shapes(its):
                    yield f"robot {one.name}, shapes", _shapes_in_words(mine, its), _shapes_edit(k, its)
                if mine == its or (own and each.name == "model"):
                    continue
                name = f"{'body' if kind == 'bodies' else 'robot'} {one.name}, {each.name}"
                yield name, words_apart(mine, its), _part_edit(kind, k, each.name, its)
    for each in fields(ours.scene):
        mine, its = getattr(ours.scene, each.name), getattr(theirs.scene, each.name)
        if each.name not in ("name", *PARTS) and mine != its:
            yield f"scene, {each.name}", words_apart(mine, its), _scene_edit(each.name, its)


def with_model(plant: ScenePlant, model: Model) -> ScenePlant:
    """Return the plant with another model of its simulated robot, which keeps its shapes if it has the same
    links."""
    known = plant.scene_robot.model
    if _same_links(model, known):
        model = replace(model, geometry=known.geometry)
    robots = tuple(
        replace(each, model=model) if each.name == plant.robot else each for each in plant.scene.robots
    )
    return replace(plant, scene=replace(plant.scene, robots=robots))


def _same_links(one: Model, other: Model) -> bool:
    return [link.name for link in one.links] == [link.name for link in other.links]


def _shapes(model: Model) -> dict[str, tuple[Collision, ...]]:
    """Return the shapes that collide, by link; those that are only seen move nothing."""
    return {name: link.collisions for name, link in model.geometry.links.items() if link.collisions}


def _shapes_in_words(ours: Model, theirs: Model) -> tuple[str, str]:
    """Describe the shapes of the links in which two robots differ."""
    mine, its = _shapes(ours), _shapes(theirs)
    apart = [name for name in {**mine, **its} if mine.get(name) != its.get(name)]

    def described(shapes: dict[str, tuple[Collision, ...]]) -> str:
        links = ((name, " and ".join(words(each) for each in shapes.get(name, ()))) for name in apart)
        return ", ".join(f"{name} {each or 'none'}" for name, each in links)

    return described(mine), described(its)


def _shapes_edit(k: int, theirs: Model) -> Edit:
    def edit(plant: ScenePlant) -> ScenePlant:
        robots = list(plant.scene.robots)
        model = replace(robots[k].model, geometry=theirs.geometry)
        robots[k] = replace(robots[k], model=model)
        return replace(plant, scene=replace(plant.scene, robots=tuple(robots)))

    return edit


def _engine(plant: ScenePlant) -> str:
    return plant.engine + "".join(f", {name}={value}" for name, value in dict(plant.settings).items())


def _part_edit(kind: str, k: int, field: str, value: Any) -> Edit:
    def edit(plant: ScenePlant) -> ScenePlant:
        parts = list(getattr(plant.scene, kind))
        parts[k] = replace(parts[k], **{field: value})
        changes: dict[str, Any] = {kind: tuple(parts)}
        return replace(plant, scene=replace(plant.scene, **changes))

    return edit


def _scene_edit(field: str, value: Any) -> Edit:
    return lambda plant: replace(plant, scene=replace(plant.scene, **{field: value}))
