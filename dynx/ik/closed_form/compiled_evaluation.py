"""Evaluation of the candidates of all branches for a batch of poses by a compiled kernel."""

from __future__ import annotations

import threading
from functools import cache
from pathlib import Path

import numpy as np

import dynx.rbd
import dynx.spatial
from dynx._version import __version__
from dynx.ik.closed_form.branches import N_BRANCHES, SIGNS
from dynx.ik.closed_form.candidates import N_MEASURES, Candidates
from dynx.ik.closed_form.chain import N_JOINTS
from dynx.simd.cache import load_kernel, source_hash
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Floats


class CompiledEvaluation:
    """Evaluation by a kernel with one branch in each lane, compiled when it is first needed."""

    def __init__(self, candidates: Candidates) -> None:
        self._candidates = candidates
        self._kernel: Kernel | None = None
        self._making = threading.Lock()

    def __call__(self, pose: Floats) -> tuple[Floats, Floats]:
        n = len(pose)
        rows = np.repeat(pose.reshape(n, 12), N_BRANCHES, axis=0)
        signs = np.tile(SIGNS, (n, 1))
        angles = np.empty((n * N_BRANCHES, N_JOINTS))
        measures = np.empty((n * N_BRANCHES, N_MEASURES))
        self.kernel([rows, signs], [angles, measures])
        return angles.reshape(n, N_BRANCHES, N_JOINTS), measures.reshape(n, N_BRANCHES, N_MEASURES)

    @property
    def kernel(self) -> Kernel:
        """The kernel."""
        if self._kernel is None:
            with self._making:
                if self._kernel is None:
                    self._kernel = self._load()
        return self._kernel

    def _load(self) -> Kernel:
        recipe = f"{_algorithms()} {self._candidates.content!r}".encode()
        inputs = {"pose": (3, 4), "signs": (3,)}
        return load_kernel(recipe, lambda: trace(self._candidates, inputs), settings=Settings(host().lanes))


@cache
def _algorithms() -> str:
    """Return the hash of the source of the packages that the kernel is traced from."""
    packages = (dynx.rbd, dynx.spatial)
    folders = [Path(__file__).parent, *(Path(str(package.__file__)).parent for package in packages)]
    return f"{__version__} {np.__version__} {source_hash(*folders)}"
