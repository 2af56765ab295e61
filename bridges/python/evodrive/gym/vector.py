"""Many environments side by side, stepped by the engine on all cores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ..shown import shown
from .actions import Discrete
from .engine import Driven, Engine, Reward, draws
from .policies import weights_of
from .rewards import Worth
from .scenarios import Scenarios
from .spaces import Observation

_MODES = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}


def _mode(autoreset):
    name = autoreset.name.lower() if isinstance(autoreset, AutoresetMode) else autoreset
    if name not in _MODES:
        raise ValueError(f"autoreset is {shown(autoreset)}; expected one of {', '.join(_MODES)}")
    return name


class VecEnv(Driven, VectorEnv[Any, Any, NDArray[Any]]):
    """`num_envs` environments that drive `scenarios`, each with a new scene and program at every reset.

    num_envs       n
    threads        that step them; 0 is one a core. The numbers are the same for any
    observation    "metadrive-1": float32 (n, 126); "safebench-2" (or "safebench-1"): float32 (n, 4); "arrays-1": a dictionary of arrays, in
                   metres, seconds and radians in the ego's frame: ego (n, 9), route (n, 20, 2), neighbours (n, 32, 10), lanes (n, 64, 6);
                   or Observation(...), which has settings of these and a stack of moments
    actions        without it steering and pedal, float32 (n, 2) from -1 to 1; Discrete(...): their numbers
    reward         MetaDriveReward(...), SafeBenchReward(...), or a function of a record of a step; without it MetaDriveReward()
    cost           a function of such a record, for `info["cost"]`
    autoreset      "next_step", "same_step" or "disabled", as in Gymnasium
    out_of_bounds  "raise", or "clip" of actions to -1 .. 1; one that is NaN is refused either way
    by_failure     how often a scene comes up whose episodes all end in a contact or off the road, beside one whose episodes never do
    seed           of the first reset: environment i draws by seed + i
    preventable    whether `info` says of contacts with an adversary if a careful ego would have prevented them, for which the episode is
                   simulated once more when it ends
    keep           whether `episode(i)` gives the last episode of an environment as a rollout to be drawn and labelled
    copy           whether observations and infos are the caller's own, as in Gymnasium's vector environments. With False they are
                   views of memory that the engine owns, observations of two sheets in turn: what a step returned stays as it is
                   during the next step, and is written over by the one after it
    render_mode    "rgb_array": `render()` gives a picture of each environment, uint8 (height, width, 3), the ego in the middle. Everyone's
                   motion is kept then

    Pickled or deep-copied it goes on as the original does.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        scenarios: Scenarios | Mapping[str, Any],
        num_envs: int = 1,
        threads: int = 0,
        observation: str | Observation | Mapping[str, Any] = "metadrive-1",
        reward: Reward = None,
        autoreset: str | AutoresetMode = "next_step",
        seed: int | None = None,
        preventable: bool = False,
        keep: bool = False,
        copy: bool = True,
        cost: Worth | None = None,
        out_of_bounds: str = "raise",
        by_failure: float = 1.0,
        actions: Discrete | Mapping[str, Any] | None = None,
        render_mode: str | None = None,
        width: int = 480,
    ) -> None:
        mode = _mode(autoreset)
        self._engine = Engine(
            scenarios, num_envs, threads, observation, reward, cost, mode, out_of_bounds, by_failure, preventable, keep, actions, render_mode, width
        )
        self.observation, self.num_envs, self.render_mode, self.copy = observation, num_envs, render_mode, copy
        self._set_autoreset(self._engine.autoreset)
        self.single_observation_space, self.single_action_space = self._engine.seen.space, self._engine.taken.space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._shape, self._first_seed, self._begun = (num_envs, *self.single_action_space.shape), seed, False
        #: The policy that is being trained, around which adversaries are planned: a torch module, an SB3 model, arrays, a file
        #: (whatever `save_policy` takes), or a function that gives one.
        self.policy: Any = None
        self._steps, self._replan_at = 0, self.scenarios.replan_every

    def _set_autoreset(self, mode):
        self._engine.set_autoreset(mode)
        self.metadata = {**self.metadata, "autoreset_mode": _MODES[mode]}

    @property
    def threads(self) -> int:
        """How many threads step it."""
        return self._engine.native.threads

    @property
    def steps(self) -> int:
        """Steps so far, all environments together."""
        return self._steps

    def reset(self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """New episodes everywhere; with `options={"reset_mask": array of bool}` there alone. `seed` is a number (environment i
        draws by seed + i) or a list. `options={"program": name, "scene": id}` begins that one."""
        if seed is None and self._first_seed is not None:
            seed = self._first_seed
        self._first_seed = None
        if seed is not None:
            seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, (int, np.integer)) else list(seed)
            if len(seeds) != self.num_envs:
                raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments; expected one each, or a number")
            self._engine.native.seed([(i, int(of)) for i, of in enumerate(seeds) if of is not None])
            super().reset(seed=int(seeds[0]) if seeds[0] is not None else None)
        options = dict(options or {})
        mask = options.pop("reset_mask", None)
        if mask is not None:
            mask = np.asarray(mask)
            if mask.dtype != bool or mask.shape != (self.num_envs,) or not mask.any():
                raise ValueError(
                    f"reset_mask is {mask.dtype} of shape {mask.shape}; expected bool of shape ({self.num_envs},), true somewhere"
                )
            mask = mask.tolist()
        sheet = self._engine.reset(mask, options)
        self._begun = True
        return self._given(self._engine.sheets[sheet]), self._given(self._engine.now)

    def _given(self, arrays):
        """An array or a dictionary of arrays as it is handed out."""
        if isinstance(arrays, dict):
            return {name: self._given(array) for name, array in arrays.items()}
        return arrays.copy() if self.copy else arrays

    def step(self, actions: ArrayLike) -> tuple[Any, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """One decision of 0.1 s in every environment."""
        engine, actions = self._engine, np.asarray(actions)
        if actions.shape != self._shape:
            raise ValueError(f"actions have the shape {actions.shape}; expected {self._shape}: {engine.taken.said} a row")
        ended, sheet = engine.step(actions, lambda i: f"environment {i}: ")
        rewards, costs, returns = engine.judged()
        info = self._given(engine.now)
        if engine.autoreset != "same_step":
            info["episode_return"] = self._given(returns)
        elif ended:
            over = engine.terminated | engine.truncated
            final = {name: array.copy() for name, array in engine.reports.items()} | {"episode_return": returns.copy()}
            info["final_info"] = {**final, **{f"_{name}": over.copy() for name in final}}
            seen = self._given(engine.final)
            if self.copy:  # rows of episodes that go on still hold what ended before
                for of in seen.values() if isinstance(seen, dict) else [seen]:
                    of[~over] = 0
            info["final_obs"], info["_final_obs"], info["_final_info"] = seen, over.copy(), over
        if costs is not None:
            info["cost"], info["_cost"] = costs, np.ones(self.num_envs, dtype=bool)
        self._steps += self.num_envs
        if self._replan_at is not None and self._steps >= self._replan_at:
            self._replan()
        return self._given(engine.sheets[sheet]), rewards, engine.terminated.copy(), engine.truncated.copy(), info

    def _replan(self):
        """Adversaries planned around the policy as it was one interval ago come in, and those around the present one are begun: so
        planning is off the step path, and which step they come in at does not depend on how long it takes."""
        if self.policy is None:
            raise RuntimeError("plan_around='policy' needs the policy; set env.policy to it, or to a function that gives it")
        self._engine.native.adopt()
        self._engine.native.plan_around(None, weights_of(self.policy, self.observation))
        self._replan_at += self.scenarios.replan_every

    def replan(self, policy: Any) -> None:
        """Plans adversaries around a policy now, and waits for it; episodes that begin from now on have them."""
        self._engine.native.plan_around(None, weights_of(policy, self.observation))
        self._engine.native.adopt()

    def render(self, indices: Sequence[int] | None = None) -> tuple[NDArray[np.uint8], ...] | None:
        """A picture of the present moment in every environment, or in those of `indices` alone; drawing takes far longer than a step."""
        if not draws(self.render_mode, self._begun):
            return None
        indices = range(self.num_envs) if indices is None else list(indices)
        for i in indices:
            if isinstance(i, bool) or not isinstance(i, (int, np.integer)) or not 0 <= i < self.num_envs:
                raise ValueError(f"no environment {shown(i)}; expected numbers from 0 to {self.num_envs - 1}")
        return tuple(self._engine.picture(int(i)) for i in indices)

    def episode(self, i: int) -> str | None:
        """The last episode that environment `i` ended, as the text of a file for `evodrive scenes show --episode`; None before
        the first. Needs `keep=True`."""
        return self._engine.native.kept(i)

    def puffer(self, buf: Any = None, seed: int | None = None) -> Any:
        """The same environments as PufferLib's native one (`pufferlib.PufferEnv`), which writes into `buf` where it is given."""
        from .adapters import puffer

        return puffer(self, buf, seed)

    def close_extras(self, **_: Any) -> None:
        self._engine.native.close()

    def __repr__(self) -> str:
        return f"VecEnv({self.num_envs} environments, {self._engine.seen.said}, {self.threads} threads, {self._engine.autoreset})"
