"""The engine's part of one environment or many: what Python handed over looked at first, its arrays as numpy sees them, its state."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec

from .. import _evodrive
from ..shown import shown
from .rewards import MetaDriveReward, Record, SafeBenchReward, Worth, Worths, reward_of
from .actions import Actions
from .scenarios import CONTACT_CLASSES, ENDS, HeldOut, Path_, Scenarios
from .spaces import Seen

#: A reward as a rule or a function of what the step did.
Reward = MetaDriveReward | SafeBenchReward | Worth | Mapping[str, Any] | None

#: Arrays of `info` about the episode that the step belonged to, and what the engine calls them.
REPORTS = {
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


class Engine:
    """A fleet of the engine. It is pickled as what it was made of and what was done since, which is done again elsewhere."""

    def __init__(
        self, scenarios, places, threads, observation, reward, cost, autoreset, out_of_bounds, by_failure, preventable, keep, actions, render_mode, width
    ):
        self.seen, self.taken, self.drawn_px = Seen(observation), Actions(actions), drawn_px(render_mode, width)
        scenarios, self.clips = scenarios_of(scenarios), clips(out_of_bounds)
        if cost is not None and not callable(cost):
            raise TypeError(f"cost is a {type(cost).__name__}; expected a function of a record, or None")
        self.scenarios, self.autoreset = scenarios, autoreset
        self.rule, self.worth = reward_of(reward)
        self.cost, self.worths = cost, Worths()
        self.sums = np.zeros(places)
        given = {"places": places, "threads": threads, "observation": self.seen.plain, "reward": json.dumps(self.rule._plain())}
        self._given = given | {"by_failure": by_failure, "preventable": preventable, "keep": keep, "motion": render_mode is not None}
        self._open(scenarios._driver)

    def _open(self, around, state=None):
        ego, weights = around
        self.native = _evodrive.Fleet(
            self.scenarios._native, **self._given, autoreset=self.autoreset, ego=ego, weights=weights, state=state
        )
        of = lambda name: np.asarray(self.native.array(name))
        self.actions, self.rewards, self.terminated, self.truncated = map(of, ("actions", "rewards", "terminated", "truncated"))
        self.sheets = [self.seen.views(of(f"observations_{k}")) for k in (0, 1)]
        self.final = self.seen.views(of("final_observations"))
        self.reports = {name: of(source) for name, source in REPORTS.items()}
        self.did = of("step")
        self._show()

    def _show(self):
        # With "same_step" the reports are of the episode that is over.
        of = lambda name: np.asarray(self.native.array(name))
        now = {"scene": of("now_scene"), "program": of("now_program")} if self.autoreset == "same_step" else self.reports
        self.now = {**now, **{f"_{name}": np.ones(len(self.sums), dtype=bool) for name in now}}

    def __getstate__(self):
        views = {"native", "actions", "rewards", "terminated", "truncated", "sheets", "final", "reports", "did", "now"}
        return {name: of for name, of in vars(self).items() if name not in views} | {"state": self.native.state()}

    def __setstate__(self, given):
        state, around, pending = given.pop("state")
        vars(self).update(given)
        self._open(around, state)
        if pending is not None:
            self.native.plan_around(*pending)

    def set_autoreset(self, mode):
        self.native.set_autoreset(mode)
        self.autoreset = mode
        self._show()

    def reset(self, mask, options):
        """Which sheet of observations is written."""
        sheet = self.native.reset(mask, named_task(self.scenarios, options))
        self.sums[slice(None) if mask is None else mask] = 0.0
        if mask is None:
            self.worths.spoiled = None
        return sheet

    def step(self, actions, who):
        """Carries actions out: how many episodes ended, and which sheet of observations is written."""
        self.worths.check()
        if self.taken.given is not None:
            is_read = ~(self.terminated | self.truncated) if self.autoreset == "next_step" else None
            actions = self.taken.driven(actions, who, is_read)
        np.copyto(self.actions, actions, casting="same_kind")
        if self.clips:
            np.clip(self.actions, -1.0, 1.0, out=self.actions)
        return self.native.step()

    def picture(self, i):
        """The present moment of an environment."""
        scene, program = self.scenarios._ids[self.now["scene"][i]], self.scenarios._names[self.now["program"][i]]
        return frame(self.native.picture(i, self.drawn_px, f"{scene}, {program}"))

    def judged(self):
        """Rewards of the step, costs where they are asked for, and the episodes' returns: a call of the caller's functions an environment."""
        rewards = self.rewards.copy()
        costs = None if self.cost is None else np.zeros(len(rewards))
        returns = self.reports["episode_return"]
        if self.worth is None and costs is None:
            return rewards, costs, returns
        columns = [of.tolist() for name, of in self.reports.items() if name != "episode_return"]
        for i, (row, did) in enumerate(zip(zip(*columns), self.did.tolist())):
            record = dict(zip(REPORTS, row)) | dict(zip(STEP, did)) | {"reward": float(rewards[i])}
            if record["episode_length"] == 0:
                continue  # a reset in place of a step
            record["scene"], record["program"] = self.scenarios._ids[record["scene"]], self.scenarios._names[record["program"]]
            record["end"], record["contact_class"] = end_name(record["end"]), class_name(record["contact_class"])
            record["preventable"] = None if record["preventable"] < 0 else bool(record["preventable"])
            if costs is not None:
                costs[i] = self.worths.of("cost", self.cost, dict(record), f"environment {i}")
            if self.worth is not None:
                rewards[i] = self.worths.of("reward", self.worth, record, f"environment {i}")
        if self.worth is not None:
            self.sums += rewards
            returns = self.sums.copy()
            self.sums[self.terminated | self.truncated] = 0.0
        return rewards, costs, returns


#: What a record says of the step, beside what `info` says of the episode.
STEP = tuple(_evodrive.step_names())


class Driven:
    """What one environment and many have in common."""

    _engine: Engine
    _spec: EnvSpec | None = None

    @property
    def scenarios(self) -> Scenarios:
        """What is driven."""
        return self._engine.scenarios

    @property
    def mix(self) -> Mapping[str, float]:
        """Program -> share."""
        return self.scenarios.mix

    @mix.setter
    def mix(self, _: Any) -> None:
        raise AttributeError("the mix is not assigned; call env.set_mix({'plain': 0.3, ...}), which episodes that begin from then on have")

    def set_mix(self, mix: Mapping[str, float], programs: Mapping[str, Path_ | None] | None = None) -> None:
        """Other shares, and further `programs` (name -> file, family or None; a name that is there gets the other file). Episodes that
        begin from now on have them; `env.scenarios` is then of them, and names keep their numbers in `info`."""
        scenarios = self.scenarios._with(mix, programs or {})
        self._engine.native.take(scenarios._native)
        self._engine.scenarios = scenarios

    @property
    def scene_weights(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """How often each scene comes up beside the others, in the order of `scenarios.scenes`: 1 to `by_failure`."""
        known = self._engine.native.weights()
        return np.array(known + [1.0] * (len(self.scenarios.scenes) - len(known)))

    @property
    def spec(self) -> EnvSpec | None:
        """Of `gymnasium.make`."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            # As plain values, so that `spec.to_json()` says everything and `gymnasium.make` of it makes the same.
            spec = dataclasses.replace(spec, kwargs={name: getattr(of, "_plain", lambda of=of: of)() for name, of in spec.kwargs.items()})
        self._spec = spec


def scenarios_of(scenarios):
    """Scenarios to be trained in."""
    if isinstance(scenarios, HeldOut):
        raise TypeError("held-out scenes are not trained in; evodrive.gym.evaluate(policy, scenarios.held_out) drives them")
    if isinstance(scenarios, Mapping):
        scenarios = Scenarios(**scenarios)  # of a spec that was JSON
    if not isinstance(scenarios, Scenarios):
        raise TypeError(f"scenarios is a {type(scenarios).__name__}; expected evodrive.gym.Scenarios")
    return scenarios


def clips(out_of_bounds):
    """Whether actions out of bounds are clipped."""
    if out_of_bounds not in ("raise", "clip"):
        raise ValueError(f"out_of_bounds is {shown(out_of_bounds)}; expected 'raise' or 'clip'")
    return out_of_bounds == "clip"


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


def drawn_px(render_mode, width):
    """The width of pictures."""
    if render_mode not in (None, "rgb_array"):
        raise ValueError(f"render_mode is {shown(render_mode)}; expected None or 'rgb_array'")
    if isinstance(width, bool) or not isinstance(width, (int, float, np.integer)) or not 200 <= width <= 4000:
        raise ValueError(f"width is {shown(width)}; expected 200 to 4000 pixels")
    return float(width)


def frame(picture):
    """A picture of the engine's as an array of one's own."""
    height, width, rgb = picture
    return np.frombuffer(rgb, np.uint8).reshape(height, width, 3).copy()


def draws(render_mode, is_begun):
    """Whether there is something to draw; says why not."""
    if render_mode is None:
        gymnasium.logger.warn("render() without a render_mode; make the environment with render_mode='rgb_array'")
        return False
    if not is_begun:
        raise RuntimeError("render before the first reset; call reset first")
    return True


def end_name(code):
    """The name of an end in `info`, None of -1."""
    return ENDS[code] if code >= 0 else None


def class_name(code):
    """The name of a contact class in `info`, None of -1."""
    return CONTACT_CLASSES[code] if code >= 0 else None
