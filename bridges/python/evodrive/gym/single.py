"""One environment with Gymnasium's plain interface."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .actions import Discrete
from .engine import Driven, Engine, Reward, class_name, draws, end_name
from .rewards import Worth
from .scenarios import Scenarios
from .spaces import Observation


class AdversarialEnv(Driven, gymnasium.Env[Any, Any]):
    """One environment: `evodrive.gym.make("evodrive/Adversarial-v0", scenarios=...)`.

    Arguments as of `VecEnv`. With `render_mode="rgb_array"`, `render()` gives the present moment, uint8 (height, width, 3), the ego
    in the middle. Among the infos: `scene`, `program`, `route_completion`, and with the last step `end`, `contact_class`,
    `adversary` and `preventable` (None where it was not asked, or nobody was met).
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        scenarios: Scenarios | Mapping[str, Any],
        observation: str | Observation | Mapping[str, Any] = "metadrive-1",
        reward: Reward = None,
        seed: int | None = None,
        preventable: bool = False,
        keep: bool = False,
        render_mode: str | None = None,
        width: int = 480,
        cost: Worth | None = None,
        out_of_bounds: str = "raise",
        by_failure: float = 1.0,
        actions: Discrete | Mapping[str, Any] | None = None,
    ) -> None:
        self._engine = Engine(
            scenarios, 1, 1, observation, reward, cost, "disabled", out_of_bounds, by_failure, preventable, keep, actions, render_mode, width
        )
        self.observation_space, self.action_space = self._engine.seen.space, self._engine.taken.space
        self.observation, self.render_mode, self.width = observation, render_mode, width
        self._first_seed, self._begun = seed, False

    def _seen(self, sheet):
        sheet = self._engine.sheets[sheet]
        return {name: of[0].copy() for name, of in sheet.items()} if isinstance(sheet, dict) else sheet[0].copy()

    def _info(self):
        reports = self._engine.reports
        return {
            "scene": self.scenarios._ids[reports["scene"][0]],
            "program": self.scenarios._names[reports["program"][0]],
            "route_completion": float(reports["route_completion"][0]),
        }

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        seed = self._first_seed if seed is None else seed
        self._first_seed = None
        super().reset(seed=seed)
        if seed is not None:
            self._engine.native.seed([(0, int(seed))])
        elif not self._begun:
            self._engine.native.seed([(0, int(self.np_random.integers(2**63)))])
        self._begun = True
        sheet = self._engine.reset(None, dict(options or {}))
        return self._seen(sheet), self._info()

    def step(self, action: ArrayLike) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        engine, action = self._engine, np.asarray(action)
        if action.shape != self.action_space.shape:
            raise ValueError(f"the action has the shape {action.shape}; expected {self.action_space.shape}: {engine.taken.said}")
        ended, sheet = engine.step(action[None], lambda _: "")
        rewards, costs, returns = engine.judged()
        info = self._info()
        if ended:
            end, contact, adversary, preventable = (
                engine.reports[name][0] for name in ("end", "contact_class", "adversary", "preventable")
            )
            info |= {
                "end": end_name(end),
                "contact_class": class_name(contact),
                "adversary": bool(adversary),
                "preventable": None if preventable < 0 else bool(preventable),
                "episode_return": float(returns[0]),
            }
        if costs is not None:
            info["cost"] = float(costs[0])
        return self._seen(sheet), float(rewards[0]), bool(engine.terminated[0]), bool(engine.truncated[0]), info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        return self._engine.picture(0) if draws(self.render_mode, self._begun) else None

    def episode(self) -> str | None:
        """The last episode that ended, as of `VecEnv.episode`."""
        return self._engine.native.kept(0)

    def close(self) -> None:
        self._engine.native.close()
