"""Least cost of one sample of a program: bytes moved and operations."""

from __future__ import annotations

from dataclasses import dataclass

from dynx.backends.quantities import QUANTITIES
from dynx.compiled.kernels import compiles, evaluate_quantity
from dynx.compiled.simplification import simplify_mechanism
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.simd.program import Program
from dynx.simd.trace import trace
from dynx.simd.trigonometry import COS, HALF_PI, SIN

SINE_COSINE_PAIRS = 1 + len(HALF_PI) + (len(SIN) - 1) + 1 + (len(COS) + 1)
"""Number of multiply-adds in the sine and cosine of one angle: the nearest multiple of pi/2, the
reduction, and the two polynomials (`dynx.simd.trigonometry`)."""

SINE_COSINE_SINGLES = 3
"""Number of sums and products besides those multiply-adds: the multiple of pi/2 as a number, r^2, and r^3."""

_SUMS = frozenset({"add", "sub"})
_NOT_COUNTED = frozenset({"input", "constant", "sin", "cos", "neg", "abs"})


@dataclass(frozen=True)
class Cost:
    """The cost of one sample.

    `bytes` are those of the inputs and outputs, each moved once. `operations` are sums, products, quotients
    and roots. `multiply_adds` counts instructions, where a product that only one sum uses is fused with that
    sum, and any other sum or product counts as one.
    """

    bytes: int
    operations: int
    multiply_adds: int


def cost_of(program: Program) -> Cost:
    """Return the cost of a traced program; the sine and cosine of one angle are computed together."""
    nodes = program.nodes
    uses = [0] * len(nodes)
    for index in (*(arg for node in nodes for arg in node.args), *program.results):
        uses[index] += 1
    single = sum(node.op not in _NOT_COUNTED for node in nodes)
    pairs = sum(
        node.op in _SUMS and any(nodes[arg].op == "mul" and uses[arg] == 1 for arg in node.args)
        for node in nodes
    )
    angles = len({node.args[0] for node in nodes if node.op in ("sin", "cos")})
    doubles = program.n_inputs + len(program.results)
    return Cost(
        bytes=8 * doubles,
        operations=single + angles * (2 * SINE_COSINE_PAIRS + SINE_COSINE_SINGLES),
        multiply_adds=single - pairs + angles * (SINE_COSINE_PAIRS + SINE_COSINE_SINGLES),
    )


def program_of(model: Model, quantity: str, frame: str) -> Program | None:
    """Return the program that the backend `compiled` compiles for a quantity, without checks of arguments.

    Return None if that backend evaluates the quantity with NumPy because its code would be too long.
    """
    mechanism, number = simplify_mechanism(model.mechanism), model.frame_index(frame)
    described = QUANTITIES[quantity]
    name, details = quantity, described.implied_details(model)
    if described.of_frame:
        details = (number, LOCAL_WORLD_ALIGNED)
    if quantity == "forward_kinematics":
        name, details = "frame_placement", (number,)
    if not compiles(mechanism, name):
        return None
    inputs: dict[str, tuple[int, ...]] = {
        argument: (model.nq if argument == "q" else model.nv,) for argument in described.arguments
    }
    return trace(lambda **arguments: evaluate_quantity(mechanism, name, details, *arguments.values()), inputs)
