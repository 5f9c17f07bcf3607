"""The part of the backend `compiled` that follows paths of poses by kernels."""

from __future__ import annotations

from dynx.backends.base import Backend
from dynx.compiled.arguments import BatchArguments
from dynx.compiled.ik.kernels import MAX_JOINTS, path_kernel
from dynx.compiled.ik.step import TargetKind
from dynx.compiled.ik.tracking import KernelFollower
from dynx.ik import SearchLimits, Targets
from dynx.ik.coordinates import FrameCoordinates
from dynx.model import Model
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats


class PathKernels(Backend):
    """Base of the compiled backend: kernels that `track` uses, one for each frame and kind of target."""

    _arguments: BatchArguments

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        super().__init__(model, validate=validate)
        self._path_kernels: dict[tuple[str, TargetKind], IterationKernel] = {}

    def path_follower(
        self, frame: str, targets: Targets, point: Floats | None, limits: SearchLimits
    ) -> KernelFollower | None:
        """Return a follower of targets of this kind; None for a floating base, or a frame that no joint or
        more than `MAX_JOINTS` joints move."""
        self._arguments.refuse_closed()
        coordinates = FrameCoordinates(self.model, frame)
        if self.model.floating or not 0 < coordinates.count <= MAX_JOINTS:
            return None
        kind = TargetKind(targets.positions is not None, targets.rotations is not None, point is not None)
        kernel = self._path_kernels.get((frame, kind))
        if kernel is None:
            with COMPILE_LOCK:
                kernel = self._path_kernels[frame, kind] = path_kernel(self.model, frame, kind)
        return KernelFollower(kernel, coordinates, kind, point, limits)

    def _release(self) -> None:
        super()._release()
        self._path_kernels = {}
