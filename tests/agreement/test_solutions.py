"""Each engine's solution is verified by the other."""

from __future__ import annotations

from dynx.agreement import agree
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.agreement.robots import Broken, arm

DISPLACEMENT = 1e-3


class Displaced(Broken):
    """All frames displaced by a millimetre; its solutions are right by its own poses only."""

    def _frame_placements(self, q: Floats) -> Floats:
        T = super()._frame_placements(q)
        T[..., 0, 3] += DISPLACEMENT
        return T

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        T = super()._frame_placement(q, frame)
        T[..., 0, 3] += DISPLACEMENT
        return T


def test_a_configuration_that_reaches_the_target_by_its_own_poses_only_is_no_solution() -> None:
    model = arm()
    report = agree(model, [ReferenceBackend(model), Displaced(model)], samples=4, referee_samples=0)
    (row,) = [row for row in report.quantities if row.quantity == "inverse_kinematics"]
    assert not row.agree
    assert abs(row.max_abs_error - DISPLACEMENT) < 0.1 * DISPLACEMENT
