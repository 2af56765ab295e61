"""Many environments side by side, stepped by the engine on all cores."""

from __future__ import annotations

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from .. import _evodrive
from ..shown import shown
from . import spaces
from .policies import weights_of
from .rewards import MetaDriveReward, SafeBenchReward
from .scenarios import CONTACT_CLASSES, ENDS, HeldOut, Scenarios

_MODES = {
    "next_step": AutoresetMode.NEXT_STEP,
    "same_step": AutoresetMode.SAME_STEP,
    "disabled": AutoresetMode.DISABLED,
}
#: Arrays of `info` about the episode that the step belonged to, and what the engine calls them.
_REPORTS = {
    "scene": "scene",
    "program": "program",
    "end": "end",
    "contact_class": "contact_class",
    "adversary": "adversary",
    "preventable": "preventable",
    "route_completion": "route_completion",
    "episode_length": "length",
    "episode_return": "sum",
}


def _mode(autoreset):
    name = autoreset.name.lower() if isinstance(autoreset, AutoresetMode) else autoreset
    if name not in _MODES:
        raise ValueError(f"autoreset is {shown(autoreset)}; expected one of {', '.join(_MODES)}")
    return name


def native(scenarios, places, threads, observation, reward, autoreset, preventable, keep, motion):
    """The engine's part, with what Python handed over looked at first."""
    if isinstance(scenarios, HeldOut):
        raise TypeError("held-out scenes are not trained in; evodrive.gym.evaluate(policy, scenarios.held_out) drives them")
    if not isinstance(scenarios, Scenarios):
        raise TypeError(f"scenarios is a {type(scenarios).__name__}; expected evodrive.gym.Scenarios")
    if not hasattr(reward, "_json"):
        raise TypeError(f"reward is a {type(reward).__name__}; expected MetaDriveReward or SafeBenchReward")
    driver, weights = scenarios._driver
    return _evodrive.Fleet(
        scenarios._native, places, threads, observation, reward._json(), autoreset, driver, weights, preventable, keep, motion
    )


class VecEnv(VectorEnv):
    """`num_envs` environments that drive `scenarios`, each with a new scene and program at every reset.

    num_envs     n
    threads      that step them; 0 is one a core. The numbers are the same for any
    observation  "metadrive-1": float32 (n, 126); "safebench-2" (or "safebench-1"): float32 (n, 4); "arrays-1": a dictionary of arrays, in metres,
                 seconds and radians in the ego's frame: ego (n, 9), route (n, 20, 2), neighbours (n, 32, 10), lanes (n, 64, 6)
    reward       MetaDriveReward(...) or SafeBenchReward(...); without it MetaDriveReward()
    autoreset    "same_step", "next_step" or "disabled", as in Gymnasium
    seed         of the first reset: environment i draws by seed + i
    preventable  whether `info` says of contacts with an adversary if a careful ego would have prevented them, for which the episode is
                 simulated once more when it ends
    keep         whether `episode(i)` gives the last episode of an environment as a rollout to be drawn and labelled
    copy         whether observations and infos are the caller's own, as in Gymnasium's vector environments. With False they are
                 views of memory that the engine owns, observations of two sheets in turn: what a step returned stays as it is
                 during the next step, and is written over by the one after it

    `step` takes float32 (n, 2): steering and pedal, from -1 to 1.
    """

    metadata = {"render_modes": []}

    def __init__(
        self,
        scenarios: Scenarios,
        num_envs: int = 1,
        threads: int = 0,
        observation: str = "metadrive-1",
        reward: MetaDriveReward | SafeBenchReward | None = None,
        autoreset: str | AutoresetMode = "same_step",
        seed: int | None = None,
        preventable: bool = False,
        keep: bool = False,
        copy: bool = True,
    ):
        mode = _mode(autoreset)
        self.observation, self.reward = observation, MetaDriveReward() if reward is None else reward
        single = spaces.observation_space(observation)
        self._native = native(scenarios, num_envs, threads, observation, self.reward, mode, preventable, keep, False)
        self.num_envs, self.scenarios, self.render_mode, self.copy = num_envs, scenarios, None, copy
        self.metadata = {**self.metadata, "autoreset_mode": _MODES[mode]}
        self.single_observation_space, self.single_action_space = single, spaces.action_space()
        self.observation_space = batch_space(single, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._mode, self._shape, self._first_seed = mode, (num_envs, 2), seed
        of = lambda name: np.asarray(self._native.array(name))
        self._actions, self._rewards = of("actions"), of("rewards")
        self._terminated, self._truncated = of("terminated"), of("truncated")
        self._sheets = [spaces.views(of(f"observations_{k}"), observation) for k in (0, 1)]
        self._final = spaces.views(of("final_observations"), observation)
        self._reports = {name: of(source) for name, source in _REPORTS.items()}
        all_of_them = np.ones(num_envs, dtype=bool)
        now = {"scene": of("now_scene"), "program": of("now_program")} if mode == "same_step" else self._reports
        self._now = {**now, **{f"_{name}": all_of_them for name in now}}
        #: The policy that is being trained, around which adversaries are planned: a torch module, an SB3 model, arrays, a file
        #: (whatever `save_policy` takes), or a function that gives one.
        self.policy = None
        self._steps, self._replan_at = 0, scenarios.replan_every

    @property
    def threads(self):
        """How many threads step it."""
        return self._native.threads

    @property
    def steps(self):
        """Steps so far, all environments together."""
        return self._steps

    def reset(self, *, seed=None, options=None):
        """New episodes everywhere; with `options={"reset_mask": array of bool}` there alone. `seed` is a number (environment i
        draws by seed + i) or a list. `options={"program": name, "scene": id}` begins that one."""
        if seed is None and self._first_seed is not None:
            seed = self._first_seed
        self._first_seed = None
        if seed is not None:
            seeds = [seed + i for i in range(self.num_envs)] if isinstance(seed, (int, np.integer)) else list(seed)
            if len(seeds) != self.num_envs:
                raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments; expected one each, or a number")
            self._native.seed([(i, int(of)) for i, of in enumerate(seeds) if of is not None])
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
        sheet = self._native.reset(mask, named_task(self.scenarios, options))
        return self._given(self._sheets[sheet]), self._given(self._now)

    def _given(self, arrays):
        """An array or a dictionary of arrays as it is handed out."""
        if isinstance(arrays, dict):
            return {name: self._given(array) for name, array in arrays.items()}
        return arrays.copy() if self.copy else arrays

    def step(self, actions):
        """One decision of 0.1 s in every environment."""
        actions = np.asarray(actions)
        if actions.shape != self._shape:
            raise ValueError(f"actions have the shape {actions.shape}; expected {self._shape}: steering and pedal a row")
        np.copyto(self._actions, actions, casting="same_kind")
        ended, sheet = self._native.step()
        info = self._given(self._now)
        if ended and self._mode == "same_step":
            over = self._terminated | self._truncated
            info["final_obs"], info["_final_obs"] = self._given(self._final), over
            final = {name: array.copy() for name, array in self._reports.items()}
            info["final_info"] = {**final, **{f"_{name}": over for name in final}}
            info["_final_info"] = over
        self._steps += self.num_envs
        if self._replan_at is not None and self._steps >= self._replan_at:
            self._replan()
        obs = self._given(self._sheets[sheet])
        return obs, self._rewards.copy(), self._terminated.copy(), self._truncated.copy(), info

    def _replan(self):
        """Adversaries planned around the policy as it was one interval ago come in, and those around the present one are begun: so
        planning is off the step path, and which step they come in at does not depend on how long it takes."""
        if self.policy is None:
            raise RuntimeError("plan_around='policy' needs the policy; set env.policy to it, or to a function that gives it")
        self._native.adopt()
        self._native.plan_around(None, weights_of(self.policy, self.observation))
        self._replan_at += self.scenarios.replan_every

    def replan(self, policy) -> None:
        """Plans adversaries around a policy now, and waits for it; episodes that begin from now on have them."""
        self._native.plan_around(None, weights_of(policy, self.observation))
        self._native.adopt()

    def episode(self, i: int) -> str | None:
        """The last episode that environment `i` ended, as the text of a file for `evodrive scenes show --episode`; None before
        the first. Needs `keep=True`."""
        return self._native.kept(i)

    def puffer(self, buf=None, seed=None):
        """The same environments as PufferLib's native one (`pufferlib.PufferEnv`), which writes into `buf` where it is given."""
        from .adapters import puffer

        return puffer(self, buf, seed)

    def close_extras(self, **_):
        self._native.close()

    def __repr__(self):
        return f"VecEnv({self.num_envs} environments, {self.observation}, {self.threads} threads, {self._mode})"


def named_task(scenarios, options):
    """Numbers of the program and scene that options of a reset name, or None."""
    program, scene = options.pop("program", None), options.pop("scene", None)
    if options:
        raise ValueError(f"options hold {sorted(options)}; expected program and scene, and of a VecEnv reset_mask")
    if program is None and scene is None:
        return None
    names, ids = scenarios.program_names, scenarios.scenes
    program = names[0] if program is None else program
    if program not in names:
        raise ValueError(f"no program {shown(program)}; expected one of {names}")
    if scene not in ids:
        raise ValueError(f"no scene {shown(scene)} in the pool of {len(ids)}; expected one of {ids[:5]} ..")
    return names.index(program), ids.index(scene)


def end_name(code):
    """The name of an end or contact class in `info`, None of -1."""
    return ENDS[code] if code >= 0 else None


def class_name(code):
    """The name of a contact class in `info`, None of -1."""
    return CONTACT_CLASSES[code] if code >= 0 else None
