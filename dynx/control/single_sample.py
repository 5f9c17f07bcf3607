"""The dynamics of one robot at one sample, unchecked and by the shortest way: what runs inside a loop.

`Backend`'s own calls look at their arguments, broadcast batch axes and expand mimic joints; in a loop of
ten microseconds a step that would be half of the time. What goes in here must be float64 arrays of the
right shape; the loop that calls it has seen to that.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from dynx.backends import Backend


class SingleSample:
    """Questions to one backend, each a call (arrays in, array out) in the coordinates of the model."""

    def __init__(self, backend: Backend) -> None:
        self.backend = backend
        self.inverse_dynamics = _shortest(backend, "inverse_dynamics")
        """tau (nv,) of q (nq,), v (nv,), a (nv,)."""
        self.forward_dynamics = _shortest(backend, "forward_dynamics")
        """a (nv,) of q, v, tau; NaN or infinity may come back where the mass matrix is singular."""
        self.bias_torque = _shortest(backend, "bias_torque")
        """C v + g (nv,) of q, v."""
        self.gravity_torque = _shortest(backend, "gravity_torque")
        """g (nv,) of q."""
        self.mass_matrix = _shortest(backend, "mass_matrix")
        """M (nv, nv) of q."""

    def in_this_thread(self, question: str) -> Any:
        """The same call for the calling thread alone, shorter still where the engine has one."""
        usual, backend = getattr(self, question), self.backend
        if backend.model.mechanism.coupling is not None or _has_own_way(backend, question):
            return usual
        return backend._in_this_thread(question) or usual

    def __reduce__(self) -> tuple[Any, ...]:
        return SingleSample, (self.backend,)


def _shortest(backend: Backend, question: str) -> Any:
    """The engine's hook itself, unless tree coordinates differ or the class has a quick way of its own."""
    if _has_own_way(backend, question) or backend.model.mechanism.coupling is not None:
        return getattr(backend, question)
    hook = getattr(backend, f"_{question}")
    # Without what turns the engine's exceptions into ours: the loop does that for all of a step.
    bare = getattr(hook, "__wrapped__", None)
    return hook if bare is None else partial(bare, backend)


def _has_own_way(backend: Backend, question: str) -> bool:
    """Whether its class, or it alone, answers otherwise than by the hook of its engine."""
    own = vars(backend)
    replaced = question in own or f"_{question}" in own
    return replaced or getattr(type(backend), question) is not getattr(Backend, question)
