"""Several agents in one scene, with PettingZoo's parallel interface. Imported where it is asked for: PettingZoo need not be there."""

from __future__ import annotations

import copy
import json
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pettingzoo import ParallelEnv

from .. import _evodrive
from ..shown import shown
from .actions import Actions
from .engine import STEP, class_name, clips, draws, drawn_px, end_name, frame, named_task, scenarios_of
from .rewards import Worths, reward_of
from .spaces import Seen


class SharedEnv(ParallelEnv[str, Any, Any]):
    """What `evodrive.gym.parallel_env` gives. Pickled or deep-copied it goes on as the original does."""

    metadata: dict[str, Any] = {
        "name": "evodrive_parallel_v0", "render_modes": ["rgb_array"], "render_fps": 10, "is_parallelizable": True
    }  # fmt: skip

    def __init__(self, scenarios, agents, others, observation, reward, seed, out_of_bounds, actions, render_mode, width):
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
        (rule, self._worth), self._worths = reward_of(reward), Worths()
        self._seen, self._taken, self._drawn_px = Seen(observation), Actions(actions), drawn_px(render_mode, width)
        self._spaces = {f"agent_{i}": (copy.deepcopy(self._seen.space), copy.deepcopy(self._taken.space)) for i in range(agents)}
        self._given = int(agents), str(others), self._seen.plain, json.dumps(rule._plain()), render_mode is not None
        self.observation, self.render_mode, self.width, self._first_seed = observation, render_mode, width, seed
        self.possible_agents, self.agents, self._tracks, self._scene = list(self._spaces), [], {}, None
        #: Steps of the scene so far, and the agent that is drawn in the middle.
        self._length, self._middle = 0, 0
        self._native = _evodrive.Shared(self.scenarios._native, *self._given)

    def __getstate__(self):
        return {name: of for name, of in vars(self).items() if name != "_native"} | {"state": self._native.state()}

    def __setstate__(self, given):
        state = given.pop("state")
        vars(self).update(given)
        self._native = _evodrive.Shared(self.scenarios._native, *self._given, state)

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
        self.agents, self._worths.spoiled, self._length, self._middle = self.possible_agents[: len(tracks)], None, 0, 0
        self._scene, self._tracks = self.scenarios._ids[number], dict(zip(self.agents, tracks))
        return self._shown(seen, self.agents), {agent: self._info(agent) for agent in self.agents}

    def step(
        self, actions: Mapping[str, ArrayLike]
    ) -> tuple[dict[str, Any], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """One decision of 0.1 s of every agent that is there."""
        agents = self.agents
        self._worths.check()
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
        infos = {agent: self._info(agent, *report[1:5]) for agent, report in zip(agents, reports)}
        self._length += 1
        self.agents = [agent for agent, end in zip(agents, ends) if end is None]
        self._middle = self.possible_agents.index((self.agents or agents)[0])
        return (
            self._shown(seen, agents),
            {agent: self._reward(infos[agent], agent, report) for agent, report in zip(agents, reports)},
            {agent: end not in (None, "horizon") for agent, end in zip(agents, ends)},
            {agent: end == "horizon" for agent, end in zip(agents, ends)},
            infos,
        )

    def _action(self, agent, actions):
        if agent not in actions:
            raise ValueError(f"no action of {agent}; expected one each of {', '.join(self.agents)}")
        try:
            action = np.asarray(actions[agent], np.float32 if self._taken.given is None else None)
        except (TypeError, ValueError) as error:
            raise ValueError(f"{agent}: the action is {shown(actions[agent])}; expected two numbers: steering and pedal") from error
        if action.shape != self._taken.space.shape:
            raise ValueError(f"{agent}: the action has the shape {action.shape}; expected {self._taken.space.shape}: {self._taken.said}")
        (pair,) = self._taken.driven(action[None], lambda _: f"{agent}: ").tolist()
        if self._clips:
            pair = [min(max(of, -1.0), 1.0) if of == of else of for of in pair]
        for i, of in enumerate(pair):
            if not -1.0 <= of <= 1.0:
                raise ValueError(f"{agent}: action[{i}] is {of}; expected a number from -1 to 1")
        return pair

    def _shown(self, seen, agents):
        # An array of the caller's own each.
        sheet = np.frombuffer(seen, np.float32).reshape(len(agents), self._seen.width)
        of = lambda views: {name: array[0] for name, array in views.items()} if self._seen.cuts else views[0]
        return {agent: of(self._seen.views(sheet[i : i + 1].copy())) for i, agent in enumerate(agents)}

    def _reward(self, info, agent, report):
        if self._worth is None:
            return report[0]
        # As of a single environment, in which nobody is an adversary, and what `infos` says of an agent.
        program = next(name for name, share in self.scenarios.mix.items() if share > 0)
        same = {"program": program, "adversary": False, "preventable": None, "episode_length": self._length, "reward": report[0]}
        return self._worths.of("reward", self._worth, {**info, **same, "agent": agent, **dict(zip(STEP, report[5]))}, agent)

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """The present moment, uint8 (height, width, 3), the first agent that still drives in the middle, the others marked."""
        if not draws(self.render_mode, self._scene is not None):
            return None
        return frame(self._native.picture(self._middle, self._drawn_px, f"{self._scene}, {self.possible_agents[self._middle]}"))

    def _info(self, agent, end=-1, contact=-1, completion=0.0, met=None):
        return {
            "scene": self._scene,
            "track": self._tracks[agent],
            "route_completion": completion,
            "end": end_name(end),
            "contact_class": class_name(contact),
            "with": None if met is None else self.possible_agents[met],
        }
