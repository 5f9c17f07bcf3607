"""Sentences on what prevents a configuration that keeps all margins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from dynx.ik.avoidance.avoidance import Avoidance, NearPair


def collision_sentence(
    avoidance: Avoidance,
    blockers: Sequence[NearPair],
    pairs: Counter[tuple[int, int]],
    count: int,
    *,
    complete: bool,
) -> str:
    """Return which pairs are too close in the best of `count` solutions, and which in most of them."""
    worst = max(blockers, key=lambda each: each.pair.margin - each.separation.lower)
    kind = "solutions of the closed form" if complete else "solutions found"
    start = f"each of the {count} {kind}" if count > 1 else "the only solution found"
    sentence = f"{start} is too close to something; in the best one {pair_sentence(avoidance, worst)}"
    (a, b), most = max(pairs.items(), key=lambda each: (each[1], each[0]))
    if count > 1 and ((a, b) != (worst.pair.a, worst.pair.b) or most == count):
        names = avoidance.parts[a].name, avoidance.parts[b].name
        share = "all of them" if most == count else f"{most} of them"
        sentence += f"; {names[0]} and {names[1]} are too close in {share}"
    return sentence


FIXED = "the joints that move the frame do not change that"
OF_TARGET = "so it is in every configuration that reaches the target"
"""Why a pair is too close in every solution."""


def inevitable_sentence(avoidance: Avoidance, blockers: Sequence[NearPair], reason: str) -> str:
    """Return that a pair is too close in every solution, and the reason."""
    return f"{closest_sentence(avoidance, blockers)}; {reason}"


def closest_sentence(avoidance: Avoidance, near: Sequence[NearPair]) -> str:
    """Return how close the pair is that lacks most of its margin; empty without pairs that are too close."""
    if not near:
        return ""
    return pair_sentence(avoidance, max(near, key=lambda each: each.pair.margin - each.separation.lower))


def pair_sentence(avoidance: Avoidance, near: NearPair) -> str:
    """Return how close two bodies are, and their margin."""
    a, b = avoidance.names(near.pair)
    found, margin = near.separation.lower, near.pair.margin
    if found < 0.0:
        return f"{a} and {b} overlap by {-found:.3g} m, with a margin of {margin:.3g} m"
    return f"{a} and {b} are {found:.3g} m apart, with a margin of {margin:.3g} m"
