"""The only import of Gymnasium."""

from __future__ import annotations

from dynx.errors import NotInstalledError

try:
    from gymnasium import Env, Space, spaces
    from gymnasium.envs.registration import register, registry
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as error:
    raise NotInstalledError(f"environments need Gymnasium: pip install 'dynx[envs]' ({error})") from error

__all__ = [
    "AutoresetMode",
    "Env",
    "Space",
    "VectorEnv",
    "batch_space",
    "register",
    "registry",
    "spaces",
]
