"""Environments at the simulator's speed, in which evolved adversaries drive.

    import evodrive.gym as eg
    src = eg.Scenarios(pool="my.pool", programs={"plain": None, "evolved": "program.json"}, mix={"plain": 0.3, "evolved": 0.7})
    env = eg.VecEnv(src, num_envs=1024, reward=eg.MetaDriveReward(crash=30.0), seed=1)
    obs, info = env.reset()
    obs, rewards, terminated, truncated, info = env.step(env.action_space.sample())
"""

from typing import TYPE_CHECKING, Any

import gymnasium as _gymnasium

from .actions import Discrete
from .adapters import sb3
from .engine import Reward
from .evolving import evolve
from .policies import evaluate, save_policy
from .rewards import MetaDriveReward, Record, SafeBenchReward
from .scenarios import CONTACT_CLASSES, ENDS, HeldOut, Scenarios, generate
from .single import AdversarialEnv
from .spaces import Observation
from .vector import VecEnv

if TYPE_CHECKING:
    from .parallel import SharedEnv

__all__ = [
    "AdversarialEnv",
    "CONTACT_CLASSES",
    "Discrete",
    "ENDS",
    "HeldOut",
    "ID",
    "MetaDriveReward",
    "Observation",
    "Record",
    "SafeBenchReward",
    "Scenarios",
    "VecEnv",
    "evaluate",
    "evolve",
    "generate",
    "make",
    "parallel_env",
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


def parallel_env(
    scenarios: Scenarios,
    agents: int = 8,
    others: str = "recorded",
    observation: str | Observation = "metadrive-1",
    reward: Reward = None,
    seed: int | None = None,
    out_of_bounds: str = "raise",
    actions: Discrete | None = None,
    render_mode: str | None = None,
    width: int = 480,
) -> "SharedEnv":
    """A `pettingzoo.ParallelEnv` of plain scenes in which several drive: `agent_0` is the scene's ego, `agent_1` .. are vehicles that were
    recorded in it, those nearest to the ego first; a scene with fewer has fewer. `others` says what vehicles do that could be agents and
    are not: "recorded", or a driver ("idm", "idm-lights", "pdm", "frenet"). All else is as recorded. Other arguments as of `VecEnv`."""
    try:
        from .parallel import SharedEnv
    except ModuleNotFoundError as error:
        if error.name != "pettingzoo":
            raise
        raise ImportError("parallel_env needs PettingZoo: pip install pettingzoo") from error
    return SharedEnv(scenarios, agents, others, observation, reward, seed, out_of_bounds, actions, render_mode, width)
