"""Several agents in one scene, with PettingZoo's parallel interface. Imported where it is asked for: PettingZoo need not be there."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from pettingzoo import ParallelEnv

from .. import _evodrive
from ..shown import shown
from . import spaces
from .engine import class_name, clips, end_name, named_task, scenarios_of
from .rewards import reward_of


class SharedEnv(ParallelEnv[str, Any, Any]):
    """What `evodrive.gym.parallel_env` gives."""

    metadata: dict[str, Any] = {"name": "evodrive_parallel_v0", "render_modes": [], "is_parallelizable": True}
    render_mode = None

    def __init__(self, scenarios, agents, others, observation, reward, seed, out_of_bounds):
        self.scenarios = scenarios_of(scenarios)
        driven = [name for name, of in self.scenarios.programs.items() if of is not None and self.scenarios.mix[name] > 0]
        if driven:
            raise ValueError(
                f"program {driven[0]} is in the mix; expected plain scenes alone: a program plans its adversaries around one ego, "
                "and here several drive. Leave it out, or give it the share 0"
            )
        if isinstance(agents, bool) or not isinstance(agents, (int, np.integer)) or not 1 <= agents <= 1024:
            raise ValueError(f"agents is {shown(agents)}; expected a number from 1 to 1024")
        self._clips = clips(out_of_bounds)
        rule, function = reward_of(reward)
        if function is not None:
            raise TypeError("reward is a function; expected MetaDriveReward or SafeBenchReward, which hold for every agent alike")
        self._spaces = {f"agent_{i}": (spaces.observation_space(observation), spaces.action_space()) for i in range(agents)}
        self._native = _evodrive.Shared(self.scenarios._native, int(agents), str(others), observation, json.dumps(rule._plain()))
        self.observation, self._first_seed = observation, seed
        self._width = len(_evodrive.bounds(observation)[0])
        self.possible_agents, self.agents, self._tracks, self._scene = list(self._spaces), [], {}, None

    def observation_space(self, agent: str) -> Any:
        return self._spaces[agent][0]

    def action_space(self, agent: str) -> Any:
        return self._spaces[agent][1]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
        """A new scene: drawn, or that of `options={"scene": id}`."""
        options = dict(options or {})
        scene = options.pop("scene", None)
        if options:  # PettingZoo's own test gives some, so they are no error
            warnings.warn(f"options hold {sorted(options)}, which nobody reads; expected scene", stacklevel=2)
        task = None if scene is None else named_task(self.scenarios, {"scene": scene})[1]
        seed, self._first_seed = self._first_seed if seed is None else seed, None
        number, tracks, seen = self._native.reset(None if seed is None else int(seed), task)
        self.agents = self.possible_agents[: len(tracks)]
        self._scene, self._tracks = self.scenarios._ids[number], dict(zip(self.agents, tracks))
        return self._seen(seen, self.agents), {agent: self._info(agent) for agent in self.agents}

    def step(
        self, actions: Mapping[str, ArrayLike]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """One decision of 0.1 s of every agent that is there."""
        agents = self.agents
        if not agents:
            raise RuntimeError(
                "all agents have left; expected reset() before the next step" if self._scene else "a step before the first reset; call reset first"
            )
        for agent in actions:
            if agent not in agents:
                why = "has left the scene, or was never in it" if agent in self._spaces else "is no agent"
                raise ValueError(f"an action of {shown(agent)}, which {why}; expected one each of {', '.join(agents)}")
        seen, reports = self._native.step([self._action(agent, actions) for agent in agents])
        ends = [end_name(report[1]) for report in reports]
        infos = {agent: self._info(agent, *report) for agent, report in zip(agents, reports)}
        self.agents = [agent for agent, end in zip(agents, ends) if end is None]
        return (
            self._seen(seen, agents),
            {agent: report[0] for agent, report in zip(agents, reports)},
            {agent: end not in (None, "horizon") for agent, end in zip(agents, ends)},
            {agent: end == "horizon" for agent, end in zip(agents, ends)},
            infos,
        )

    def _action(self, agent, actions):
        if agent not in actions:
            raise ValueError(f"no action of {agent}; expected one each of {', '.join(self.agents)}")
        try:
            action = np.asarray(actions[agent], np.float32)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{agent}: the action is {shown(actions[agent])}; expected two numbers: steering and pedal") from error
        if action.shape != (2,):
            raise ValueError(f"{agent}: the action has the shape {action.shape}; expected (2,): steering and pedal")
        pair = action.tolist()
        if self._clips:
            pair = [min(max(of, -1.0), 1.0) if of == of else of for of in pair]
        for i, of in enumerate(pair):
            if not -1.0 <= of <= 1.0:
                raise ValueError(f"{agent}: action[{i}] is {of}; expected a number from -1 to 1")
        return pair

    def _seen(self, seen, agents):
        # An array of the caller's own each.
        sheet = np.frombuffer(seen, np.float32).reshape(len(agents), self._width)
        of = lambda row: {name: array[0] for name, array in spaces.views(row, self.observation).items()} if self.observation == "arrays-1" else row[0]
        return {agent: of(sheet[i : i + 1].copy()) for i, agent in enumerate(agents)}

    def _info(self, agent, _reward=0.0, end=-1, contact=-1, completion=0.0, met=None):
        return {
            "scene": self._scene,
            "track": self._tracks[agent],
            "route_completion": completion,
            "end": end_name(end),
            "contact_class": class_name(contact),
            "with": None if met is None else self.possible_agents[met],
        }
