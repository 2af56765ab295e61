"""Environments at the simulator's speed, in which evolved adversaries drive.

    import evodrive.gym as eg
    src = eg.Scenarios(pool="my.pool", programs={"plain": None, "evolved": "program.json"}, mix={"plain": 0.3, "evolved": 0.7})
    env = eg.VecEnv(src, num_envs=1024, reward=eg.MetaDriveReward(crash=30.0), seed=1)
    obs, info = env.reset()
    obs, rewards, terminated, truncated, info = env.step(env.action_space.sample())
"""

from typing import Any

import gymnasium as _gymnasium

from .adapters import sb3
from .engine import Record
from .evolving import evolve
from .policies import evaluate, save_policy
from .rewards import MetaDriveReward, SafeBenchReward
from .scenarios import CONTACT_CLASSES, ENDS, HeldOut, Scenarios, generate
from .single import AdversarialEnv
from .vector import VecEnv

__all__ = [
    "AdversarialEnv",
    "CONTACT_CLASSES",
    "ENDS",
    "HeldOut",
    "ID",
    "MetaDriveReward",
    "Record",
    "SafeBenchReward",
    "Scenarios",
    "VecEnv",
    "evaluate",
    "evolve",
    "generate",
    "make",
    "save_policy",
    "sb3",
]

#: Under which name Gymnasium knows the environment.
ID = "evodrive/Adversarial-v0"
if ID not in _gymnasium.registry:
    # The environment itself says what is wrong with a step before the first reset.
    _gymnasium.register(
        id=ID,
        entry_point="evodrive.gym.single:AdversarialEnv",
        vector_entry_point="evodrive.gym.vector:VecEnv",
        order_enforce=False,
    )


def make(id: str = ID, **options: Any) -> _gymnasium.Env[Any, Any]:
    """`gymnasium.make` of an environment of this package, without the checker of each step."""
    return _gymnasium.make(id, **{"disable_env_checker": True, **options})
