"""CasADi as a peer: adam's expressions as one function, `map`ped over the batch.

A row-major array of samples is, to CasADi, the column-major matrix of their columns. So the function reads
and writes NumPy's memory where it lies (`Function.buffer`), and nothing is converted or copied.
"""

from __future__ import annotations

import shutil
import time
from importlib import import_module
from typing import Any

import numpy as np

from benchmarks.bindings.urdf_text import moving_joints, spelled_out
from benchmarks.libraries.compiling_peer import CompilingPeer
from benchmarks.libraries.jax_peers import version_of
from dynx.backends.quantities import QUANTITIES
from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.implementations import PreparedCall
from dynx.errors import NotInstalledError
from dynx.model import Model
from dynx.spatial.scalar import Floats

COMPILER = "gcc"


class CasadiMap(CompilingPeer):
    """CasADi's own interpreter of the expressions; on several threads ``map(n, "thread", threads)``.

    The expressions are those of `AdamJax`; forward dynamics solves with CasADi's LDL'.
    """

    name = "CasADi map"
    options: dict[str, Any]

    def __init__(self, model: Model, threads: int) -> None:
        super().__init__(model, threads)
        try:
            self._casadi: Any = import_module("casadi")
            adam: Any = import_module("adam.casadi")
        except ImportError as error:
            raise NotInstalledError(f"{error}: pip install 'dynx[benchmark]'") from error
        self.version = version_of("casadi", "adam-robotics")
        self.options = {"cse": True}
        gravity = np.array([*model.gravity, 0.0, 0.0, 0.0])
        self._robot = adam.KinDynComputations(spelled_out(model), moving_joints(model), gravity=gravity)
        self._functions: dict[str, tuple[Any, float]] = {}

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """The call; the results go to `out`."""
        function = self._function(case.quantity, batch)
        kind = ("serial",) if self.threads == 1 else ("thread", self.threads)
        mapped = function.map(len(batch), *kind)
        buffer, trigger = mapped.buffer()
        for number, argument in enumerate(batch.arguments(case.quantity)):
            buffer.set_arg(number, argument.data)
        buffer.set_res(0, out.data)

        # CasADi keeps addresses: what they belong to must live as long as the call.
        def call(_keep: Any = (mapped, buffer, batch)) -> Floats:
            trigger()
            return out

        return PreparedCall(call)

    def _function(self, quantity: str, batch: Batch) -> Any:
        if quantity not in self._functions:
            begin = time.perf_counter()
            casadi = self._casadi
            arguments = [casadi.SX.sym(name, batch.model.nv) for name in QUANTITIES[quantity].arguments]
            result = self._expression(quantity, batch.frame, arguments)
            # Row-major, as the array of the results is; structural zeros are written too.
            row_major = casadi.densify(casadi.vec(result.T))
            function = casadi.Function(quantity, arguments, [row_major], self.options)
            self._functions[quantity] = function, time.perf_counter() - begin
        function, self.compile_seconds = self._functions[quantity]
        return function

    def _expression(self, quantity: str, frame: str, arguments: list[Any]) -> Any:
        casadi, robot = self._casadi, self._robot
        base, rest, q = casadi.SX.eye(4), casadi.SX.zeros(6), arguments[0]
        if quantity == "forward_kinematics":
            return robot.forward_kinematics_fun(frame)(base, q)
        if quantity == "jacobian":
            return robot.jacobian_fun(frame)(base, q)[:, 6:]
        M = robot.mass_matrix_fun()(base, q)[6:, 6:]
        if quantity == "mass_matrix":
            return M
        bias = robot.bias_force_fun()(base, q, rest, arguments[1])[6:]
        if quantity == "inverse_dynamics":
            return M @ arguments[2] + bias
        return casadi.ldl_solve(arguments[2] - bias, *casadi.ldl(M))


class CasadiCode(CasadiMap):
    """A CasADi peer whose expressions are written as C and compiled for this processor."""

    name = "CasADi map, C code"

    def __init__(self, model: Model, threads: int) -> None:
        super().__init__(model, threads)
        if shutil.which(COMPILER) is None:
            raise NotInstalledError(f"CasADi's C code needs {COMPILER}, which is not there")
        how = {"compiler": COMPILER, "flags": ["-O3", "-march=native"], "verbose": False}
        self.options = {"cse": True, "jit": True, "compiler": "shell", "jit_options": how}
