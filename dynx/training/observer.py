"""What happens between the updates of an algorithm: checkpoints, evaluations and reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from dynx.training.library import BaseCallback


class Observer(BaseCallback):  # type: ignore[misc]  # stable-baselines3 is not followed
    """Calls each action after its number of steps, when no update of the weights is half done.

    `actions` are called without arguments; one that returns True ends the training, with the weights as they
    are. `report` is called with the mean return of the last episodes, or None before the first has ended. The
    first call of each is after a full distance, so that nothing is done at the start.
    """

    def __init__(
        self,
        distances: Mapping[str, int],
        actions: Mapping[str, Callable[[], bool | None]],
        report: Callable[[float | None], None],
    ) -> None:
        super().__init__()
        self._distances = distances
        self._actions: dict[str, Callable[[], bool | None]] = {
            **actions,
            "report": lambda: report(self._mean_return()),
        }
        self._last: dict[str, int] = {}
        self._ended = False

    def _on_training_start(self) -> None:
        self._last = dict.fromkeys(self._distances, self.model.num_timesteps)

    def _on_rollout_start(self) -> None:
        # Called after the update with the steps before: weights and counters fit together.
        for name, distance in self._distances.items():
            if self.model.num_timesteps - self._last[name] >= distance:
                self._last[name] = self.model.num_timesteps
                self._ended |= self._actions[name]() is True

    def _on_step(self) -> bool:
        # False ends the training before the next update.
        return not self._ended

    def _mean_return(self) -> float | None:
        ended = [float(each["r"]) for each in self.model.ep_info_buffer or ()]
        return float(np.mean(ended)) if ended else None
