"""The only import of Gymnasium."""

from __future__ import annotations

from dynx.errors import importing

with importing("environments need Gymnasium: pip install 'dynx[envs]' ({error})"):
    from gymnasium import Env, Space, spaces
    from gymnasium import make as make_env
    from gymnasium import make_vec as make_vec_env
    from gymnasium.envs.registration import register, registry
    from gymnasium.error import Error as GymnasiumError
    from gymnasium.utils.seeding import np_random
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space

__all__ = [
    "AutoresetMode",
    "Env",
    "GymnasiumError",
    "Space",
    "VectorEnv",
    "batch_space",
    "make_env",
    "make_vec_env",
    "np_random",
    "register",
    "registry",
    "spaces",
]
