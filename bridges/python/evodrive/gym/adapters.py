"""The same environments for other libraries' interfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv as SB3VecEnv

    from .vector import VecEnv


def sb3(env: VecEnv) -> SB3VecEnv:
    """A `VecEnv` as Stable-Baselines3 wants it: set to autoreset "same_step"."""
    from stable_baselines3.common.vec_env import VecEnv as Base

    env._set_autoreset("same_step")
    keys = list(env._engine.seen.cuts)  # of an observation of several arrays

    class Adapter(Base):
        """Steps a `VecEnv`; what the library keeps is copied."""

        def __init__(self):
            self.inner = env
            super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

        @property
        def policy(self):
            """As of `VecEnv.policy`."""
            return env.policy

        @policy.setter
        def policy(self, policy):
            env.policy = policy

        def set_mix(self, mix, programs=None):
            """As of `VecEnv.set_mix`."""
            env.set_mix(mix, programs)

        def _copied(self, obs):
            if env.copy:
                return obs
            return {key: obs[key].copy() for key in keys} if isinstance(obs, dict) else obs.copy()

        def reset(self):
            seed = self._seeds[0] if self._seeds and self._seeds[0] is not None else None
            obs, _ = env.reset(seed=seed)
            self._reset_seeds()
            self._reset_options()
            return self._copied(obs)

        def step_async(self, actions):
            self._actions = actions

        def step_wait(self):
            obs, rewards, terminated, truncated, info = env.step(self._actions)
            infos = [{} for _ in range(self.num_envs)]
            if "final_info" in info:
                final, last = info["final_info"], info["final_obs"]
                for i in np.flatnonzero(info["_final_info"]):
                    of = {key: final[key][i].item() for key in final if not key.startswith("_")}
                    of["terminal_observation"] = {k: last[k][i].copy() for k in keys} if isinstance(last, dict) else last[i].copy()
                    of["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
                    of["episode"] = {"r": of["episode_return"], "l": of["episode_length"], "t": 0.0}
                    infos[i] = of
            return self._copied(obs), rewards.astype(np.float32), terminated | truncated, infos

        def get_images(self):
            return list(env.render() or ())

        def close(self):
            env.close()

        def get_attr(self, attr_name, indices=None):
            return [getattr(env, attr_name) for _ in self._get_indices(indices)]

        def set_attr(self, attr_name, value, indices=None):
            setattr(env, attr_name, value)

        def env_method(self, method_name, *args, indices=None, **kwargs):
            return [getattr(env, method_name)(*args, **kwargs) for _ in self._get_indices(indices)]

        def env_is_wrapped(self, wrapper_class, indices=None):
            return [False for _ in self._get_indices(indices)]

    return Adapter()


#: Why PufferLib may be missing: it has no wheel, its source loads from GitHub what its own games need, and its metadata ask for
#: Gymnasium 0.29, of which its environments' interface uses nothing that newer ones lack.
PUFFERLIB = (
    "pip install --no-build-isolation --no-deps pufferlib==3.0.0 gym psutil, where GitHub can be reached; or put its source "
    "distribution on the PYTHONPATH (bridges/python/README.md, Other libraries)"
)


def puffer(env: VecEnv, buf: Any = None, seed: int | None = None) -> Any:
    """A `VecEnv` (observation in one array) as PufferLib's native environment, a `pufferlib.PufferEnv`: set to autoreset "same_step". `buf`:
    PufferLib's own arrays, which are written in place; without it the environment makes them. `seed` is that of the first reset."""
    try:
        import pufferlib
    except ImportError as error:
        raise ImportError(f"PufferLib cannot be loaded: {error}. {PUFFERLIB}") from error
    if not hasattr(pufferlib, "PufferEnv"):
        raise ImportError(f"PufferLib {pufferlib.__version__} has no PufferEnv; expected 3.0. {PUFFERLIB}")
    if env._engine.seen.cuts:
        raise ValueError("PufferLib's native environments observe one array; make the VecEnv with 'metadrive-1' or 'safebench-2'")

    env._set_autoreset("same_step")

    class Puffer(pufferlib.PufferEnv):
        """Steps a `VecEnv`, an agent an environment."""

        def __init__(self):
            self.inner, self.num_agents, self.first_seed = env, env.num_envs, seed
            self.single_observation_space, self.single_action_space = env.single_observation_space, env.single_action_space
            super().__init__(buf)

        def reset(self, seed=None):
            seed = self.first_seed if seed is None else seed
            self.first_seed = None
            # PufferLib gives neighbours neighbouring seeds: each has as many as it has agents, so that no two drive the same.
            self.observations[:], _ = env.reset(seed=None if seed is None else int(seed) * env.num_envs)
            self.rewards[:], self.terminals[:], self.truncations[:], self.masks[:] = 0.0, False, False, True
            return self.observations, []

        def step(self, actions):
            # A step takes from the arrays of the buffer what it left there, so `actions` may be that buffer.
            self.observations[:], self.rewards[:], self.terminals[:], self.truncations[:], info = env.step(actions)
            infos = []
            if "final_info" in info:
                final = info["final_info"]
                for i in info["_final_info"].nonzero()[0]:
                    infos.append({name: final[name][i].item() for name in final if not name.startswith("_")})
            return self.observations, self.rewards, self.terminals, self.truncations, infos

        def close(self):
            env.close()

    return Puffer()
