"""One environment with Gymnasium's plain interface."""

from __future__ import annotations

import gymnasium
import numpy as np

from ..shown import shown
from . import spaces
from .rewards import MetaDriveReward, SafeBenchReward
from .scenarios import Scenarios
from .vector import class_name, end_name, named_task, native


class AdversarialEnv(gymnasium.Env):
    """One environment: `evodrive.gym.make("evodrive/Adversarial-v0", scenarios=...)`.

    Arguments as of `VecEnv`. With `render_mode="rgb_array"`, `render()` gives the present moment, uint8 (height, width, 3), the ego
    in the middle. Among the infos: `scene`, `program`, `route_completion`, and with the last step `end`, `contact_class`,
    `adversary` and `preventable` (None where it was not asked, or nobody was met).
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        scenarios: Scenarios,
        observation: str = "metadrive-1",
        reward: MetaDriveReward | SafeBenchReward | None = None,
        seed: int | None = None,
        preventable: bool = False,
        keep: bool = False,
        render_mode: str | None = None,
        width: int = 480,
    ):
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode is {shown(render_mode)}; expected None or 'rgb_array'")
        if not 200 <= width <= 4000:
            raise ValueError(f"width is {width}; expected 200 to 4000 pixels")
        reward = MetaDriveReward() if reward is None else reward
        self.observation_space, self.action_space = spaces.observation_space(observation), spaces.action_space()
        motion = render_mode is not None
        self._native = native(scenarios, 1, 1, observation, reward, "disabled", preventable, keep, motion)
        self.scenarios, self.observation, self.render_mode, self.width = scenarios, observation, render_mode, width
        self._first_seed, self._begun = seed, False
        of = lambda name: np.asarray(self._native.array(name))
        self._actions, self._rewards = of("actions"), of("rewards")
        self._terminated, self._truncated = of("terminated"), of("truncated")
        self._sheets = [spaces.views(of(f"observations_{k}"), observation) for k in (0, 1)]
        self._end, self._class, self._adversary, self._preventable, self._completion, self._sum = (
            of(name) for name in ("end", "contact_class", "adversary", "preventable", "route_completion", "sum")
        )
        self._scene, self._program = of("scene"), of("program")
        self._ids, self._names = scenarios.scenes, scenarios.program_names

    def _seen(self, sheet):
        sheet = self._sheets[sheet]
        return {name: of[0].copy() for name, of in sheet.items()} if isinstance(sheet, dict) else sheet[0].copy()

    def _info(self):
        return {
            "scene": self._ids[self._scene[0]],
            "program": self._names[self._program[0]],
            "route_completion": float(self._completion[0]),
        }

    def reset(self, *, seed=None, options=None):
        seed = self._first_seed if seed is None else seed
        self._first_seed = None
        super().reset(seed=seed)
        if seed is not None:
            self._native.seed([(0, int(seed))])
        elif not self._begun:
            self._native.seed([(0, int(self.np_random.integers(2**63)))])
        self._begun = True
        sheet = self._native.reset(None, named_task(self.scenarios, dict(options or {})))
        return self._seen(sheet), self._info()

    def step(self, action):
        action = np.asarray(action)
        if action.shape != (2,):
            raise ValueError(f"the action has the shape {action.shape}; expected (2,): steering and pedal")
        np.copyto(self._actions[0], action, casting="same_kind")
        ended, sheet = self._native.step()
        info = self._info()
        if ended:
            preventable = int(self._preventable[0])
            info |= {
                "end": end_name(self._end[0]),
                "contact_class": class_name(self._class[0]),
                "adversary": bool(self._adversary[0]),
                "preventable": None if preventable < 0 else bool(preventable),
                "episode_return": float(self._sum[0]),
            }
        return self._seen(sheet), float(self._rewards[0]), bool(self._terminated[0]), bool(self._truncated[0]), info

    def render(self):
        if self.render_mode is None:
            gymnasium.logger.warn("render() without a render_mode; make the environment with render_mode='rgb_array'")
            return None
        if not self._begun:
            raise RuntimeError("render before the first reset; call reset first")
        title = f"{self._ids[self._scene[0]]}, {self._names[self._program[0]]}"
        height, width, rgb = self._native.picture(0, float(self.width), title)
        return np.frombuffer(rgb, np.uint8).reshape(height, width, 3).copy()

    def episode(self) -> str | None:
        """The last episode that ended, as of `VecEnv.episode`."""
        return self._native.kept(0)

    def close(self):
        self._native.close()
