"""What a step is worth: the rules of the two settings, every constant a field. docs/EGOS.md has the formulas."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from ..shown import shown

#: What a function of one's own is given of a step, and the function (README, Rewards).
Record = dict[str, Any]
Worth = Callable[[Record], float]


@dataclass(frozen=True)
class MetaDriveReward:
    """MetaDrive's `ScenarioEnv.reward_function` (0.4.3), with its constants.

    Contact ends an episode here and not there, so a larger `crash` is what trains drivers that do not crash: 10 to 30.
    """

    driving: float = 1.0  # a metre along the route
    lateral: float = 0.5  # being `lateral_m_max` beside the route
    lateral_m_max: float = 4.0  # metres
    heading: float = 1.0  # being turned away from the route by half a turn
    steering: float = 0.5  # steering more than 1/speed
    no_negative: bool = True  # whether the sum of these is at least 0
    crash: float = 1.0  # taken off in place of the sum, at a contact
    success: float = 5.0  # in place of the sum, on arrival
    out_of_road: float = 5.0  # taken off in place of the sum, when the road is left

    def _plain(self) -> dict[str, Any]:
        return {"rule": "metadrive", **asdict(self)}


@dataclass(frozen=True)
class SafeBenchReward:
    """SafeBench's `_get_reward`, with its constants."""

    collision: float = 1.0
    speed_mps_max: float = 8.0
    too_fast: float = 10.0
    lateral_m_max: float = 4.0
    out_of_lane: float = 1.0
    steering: float = 5.0
    side: float = 0.2
    steer_share: float = 0.3

    def _plain(self) -> dict[str, Any]:
        return {"rule": "safebench", **asdict(self)}


def reward_of(reward):
    """The rule that the engine computes, and the function in its place where there is one."""
    if isinstance(reward, Mapping):  # of a spec that was JSON
        rules = {"metadrive": MetaDriveReward, "safebench": SafeBenchReward}
        if reward.get("rule") not in rules:
            raise ValueError(f"the rule of the reward is {shown(reward.get('rule'))}; expected 'metadrive' or 'safebench'")
        reward = rules[reward["rule"]](**{name: of for name, of in reward.items() if name != "rule"})
    if reward is None or isinstance(reward, (MetaDriveReward, SafeBenchReward)):
        return MetaDriveReward() if reward is None else reward, None
    if callable(reward):
        return MetaDriveReward(), reward
    raise TypeError(f"reward is a {type(reward).__name__}; expected MetaDriveReward, SafeBenchReward or a function of a record")


class Worths:
    """What functions of the caller's say of steps. One that breaks spoils the step, until the next reset."""

    spoiled: str | None = None

    def check(self):
        """Refuses a step behind one that was lost."""
        if self.spoiled:
            raise RuntimeError(f"{self.spoiled}, and the step that it was asked of is lost; expected reset() before the next step")

    def of(self, name, function, record, where):
        """A finite number."""
        try:
            worth = float(function(record))
        except Exception as error:
            self.spoiled = f"{name} raised {type(error).__name__} in {where} ({error})"
            raise RuntimeError(f"{self.spoiled}; expected a finite number. Reset before the next step") from error
        if not math.isfinite(worth):
            self.spoiled = f"{name} was {worth} in {where}"
            raise ValueError(f"{self.spoiled}; expected a finite number. Reset before the next step")
        return worth
