"""`ThreadedPPO`: PPO of stable-baselines3 whose updates compute large mini-batches in parts, on threads.

PyTorch divides each operation among threads, which wait for one another after each of them. Here each thread
computes the gradient of whole parts, and they meet once in a mini-batch. The parts fit into the cache, and
their number does not depend on that of the threads, so that neither does the policy.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from typing import Any, NamedTuple

import numpy as np

from dynx.envs.library import spaces
from dynx.simd.threads import run_parts
from dynx.training.library import PPO, explained_variance, torch
from dynx.training.schedules import SteadyDivergence

PART = 4096
"""Largest number of samples of a part of a mini-batch."""


class _Losses(NamedTuple):
    """Sums over the samples of a part, and the gradient of the loss by each parameter."""

    policy: float
    value: float
    entropy: float
    divergence: float
    clipped: float
    gradient: tuple[Any, ...]


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let PyTorch compute on the calling thread alone; those of dynx divide the work."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class ThreadedPPO(PPO):  # type: ignore[misc]  # stable-baselines3 is not followed
    """PPO with the same loss, schedules and files as that of stable-baselines3; mini-batches of more than
    `PART` samples are computed in parts, on `threads` threads."""

    threads = 1
    """Largest number of threads of an update."""

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "threads"]

    def train(self) -> None:
        """Update the policy by the present rollouts."""
        if self.batch_size <= PART and not isinstance(self.learning_rate, SteadyDivergence):
            super().train()
            return
        with _one_thread():
            self._train_in_parts()

    def collect_rollouts(self, *arguments: Any, **options: Any) -> bool:
        """Collect rollouts; PyTorch computes the actions on one thread, since the environments may use the
        others."""
        with _one_thread():
            return bool(super().collect_rollouts(*arguments, **options))

    def _update_learning_rate(self, optimizers: Any) -> None:
        # A rate that follows the divergence is a state of the optimizer, and in its checkpoints.
        if not isinstance(self.learning_rate, SteadyDivergence):
            super()._update_learning_rate(optimizers)

    def _train_in_parts(self) -> None:
        policy, buffer = self.policy, self.rollout_buffer
        policy.set_training_mode(True)
        self._update_learning_rate(policy.optimizer)
        rest = self._current_progress_remaining
        clip = self.clip_range(rest)
        clip_value = None if self.clip_range_vf is None else self.clip_range_vf(rest)
        found: list[Any] = []
        going_on = True
        (samples,) = buffer.get()
        count = len(samples.advantages)
        for _ in range(self.n_epochs):
            order = torch.randperm(count)
            for rows in torch.split(order, self.batch_size):
                losses = self._losses(samples, rows, clip, clip_value)
                found.append(losses)
                if self.target_kl is not None and losses.divergence > 1.5 * self.target_kl:
                    going_on = False
                    break
                for parameter, gradient in zip(policy.parameters(), losses.gradient, strict=True):
                    parameter.grad = gradient
                if isinstance(self.learning_rate, SteadyDivergence):
                    for group in policy.optimizer.param_groups:
                        group["lr"] = self.learning_rate.next_rate(group["lr"], losses.divergence)
                torch.nn.utils.clip_grad_norm_(policy.parameters(), self.max_grad_norm)
                policy.optimizer.step()
            self._n_updates += 1
            if not going_on:
                break
        self._record(found, clip, clip_value)

    def _losses(self, samples: Any, rows: Any, clip: float, clip_value: float | None) -> _Losses:
        """Return the means of the losses over a mini-batch, some rows of the samples, and their gradient."""
        count = len(rows)
        mean, scale = 0.0, 1.0
        if self.normalize_advantage and count > 1:
            advantages = samples.advantages[rows]
            mean, scale = advantages.mean(), advantages.std() + 1e-8
        pieces = torch.tensor_split(rows, -(-count // PART))
        found: list[Any] = [None] * len(pieces)

        def compute(k: int) -> None:
            part = type(samples)(*(each[pieces[k]] for each in samples))
            part = part._replace(advantages=(part.advantages - mean) / scale)
            found[k] = self._part(part, count, clip, clip_value)

        run_parts(compute, len(found), self.threads)
        *sums, gradients = zip(*found, strict=True)
        gradient = tuple(sum(each[1:], each[0]) for each in zip(*gradients, strict=True))
        policy, value, entropy, divergence, clipped = (sum(each) / count for each in sums)
        return _Losses(policy, value, entropy, divergence, clipped, gradient)

    def _part(self, batch: Any, count: int, clip: float, clip_value: float | None) -> _Losses:
        """Return the losses of a part of a mini-batch of `count` samples."""
        # The distribution of actions keeps its parameters, of the present part here.
        policy, actions = copy(self.policy), batch.actions
        policy.action_dist = copy(policy.action_dist)
        if isinstance(self.action_space, spaces.Discrete):
            actions = actions.long().flatten()
        values, log_prob, entropy = policy.evaluate_actions(batch.observations, actions)
        values = values.flatten()
        log_ratio = log_prob - batch.old_log_prob
        ratio = torch.exp(log_ratio)
        bounded = torch.clamp(ratio, 1.0 - clip, 1.0 + clip)
        policy_loss = -torch.min(batch.advantages * ratio, batch.advantages * bounded).sum()
        if clip_value is not None:
            old = batch.old_values
            values = old + torch.clamp(values - old, -clip_value, clip_value)
        value_loss = torch.square(batch.returns - values).sum()
        entropy_loss = (log_prob if entropy is None else -entropy).sum()
        loss = policy_loss + self.ent_coef * entropy_loss + self.vf_coef * value_loss
        parameters = tuple(policy.parameters())
        gradient = torch.autograd.grad(loss / count, parameters, allow_unused=True, materialize_grads=True)
        with torch.no_grad():
            divergence = (ratio - 1.0 - log_ratio).sum()
            clipped = (torch.abs(ratio - 1.0) > clip).sum()
        return _Losses(
            float(policy_loss.detach()),
            float(value_loss.detach()),
            float(entropy_loss.detach()),
            float(divergence),
            float(clipped),
            gradient,
        )

    def _record(self, found: list[_Losses], clip: float, clip_value: float | None) -> None:
        """Record the means over the mini-batches under the names of stable-baselines3."""
        policy, value, entropy, divergence, clipped = (
            float(np.mean(each)) for each in list(zip(*found, strict=True))[:-1]
        )
        buffer, record = self.rollout_buffer, self.logger.record
        record("train/entropy_loss", entropy)
        record("train/policy_gradient_loss", policy)
        record("train/value_loss", value)
        record("train/approx_kl", divergence)
        record("train/clip_fraction", clipped)
        record("train/loss", policy + self.ent_coef * entropy + self.vf_coef * value)
        record(
            "train/explained_variance", explained_variance(buffer.values.flatten(), buffer.returns.flatten())
        )
        if hasattr(self.policy, "log_std"):
            record("train/std", float(torch.exp(self.policy.log_std.detach()).mean()))
        record("train/n_updates", self._n_updates, exclude="tensorboard")
        record("train/clip_range", clip)
        if clip_value is not None:
            record("train/clip_range_vf", clip_value)
