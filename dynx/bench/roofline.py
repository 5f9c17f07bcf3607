"""The roofline model: the shares of memory bandwidth and arithmetic rate that a kernel reaches.

A kernel cannot be faster than its bytes over the memory bandwidth, nor than its operations over the
peak rate of arithmetic (Williams, Waterman and Patterson, Roofline, CACM 52(4), 2009).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from dynx.bench.cost import Cost

Bound = Literal["memory", "arithmetic"]


@dataclass(frozen=True)
class Peak:
    """Measured peaks of the machine on a number of threads.

    `copy_bandwidth` [B/s] counts bytes read and bytes written; `multiply_adds` [1/s] counts a product
    with a sum as one.
    """

    threads: int
    copy_bandwidth: float
    multiply_adds: float


@dataclass(frozen=True)
class Roofline:
    """The shares of both peaks that a kernel reaches, and the one that limits it.

    The share of memory may exceed 1 where a batch fits into the caches, which are faster.
    """

    memory_share: float
    arithmetic_share: float

    @property
    def binds(self) -> Bound:
        """The bound with the larger share, which limits the kernel."""
        return "memory" if self.memory_share > self.arithmetic_share else "arithmetic"

    @property
    def share(self) -> float:
        """The larger of the two shares."""
        return max(self.memory_share, self.arithmetic_share)


def roofline(cost: Cost, seconds: float, peak: Peak) -> Roofline:
    """Return the roofline of a kernel that takes `seconds` for a sample of this cost."""
    return Roofline(
        memory_share=cost.bytes / peak.copy_bandwidth / seconds,
        arithmetic_share=cost.multiply_adds / peak.multiply_adds / seconds,
    )
