"""Spaces of observations, with the bounds that the engine keeps to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from .. import _evodrive
from ..shown import shown


@dataclass(frozen=True)
class Observation:
    """An observation with settings of one's own; what is None is as in the standard one of this name.

    name           "metadrive-1", "safebench-1", "safebench-2" or "arrays-1"
    stack          moments that are seen, 1 to 64, along a first axis, the newest last. In an episode's first steps its first moment stands in
                   for those before it. With 1 there is no such axis
    neighbours     road users that are described one by one, the nearest first: 1 to 64, of "arrays-1" (32) and "metadrive-1" (6)
    range_m        of "arrays-1": how far road users are seen, metres (100), 500 at most
    lanes          of "arrays-1": pieces of lanes, the nearest first, 1 to 256 (64)
    lanes_range_m  of "arrays-1": how far they are seen (60)
    goal           of "arrays-1": a further array `goal`: x, y of the route's end in the ego's frame, and route left, metres
    """

    name: str = "metadrive-1"
    stack: int = 1
    neighbours: int | None = None
    range_m: float | None = None
    lanes: int | None = None
    lanes_range_m: float | None = None
    goal: bool = False

    def __post_init__(self) -> None:
        for name, of in self._plain().items():
            if name == "name" and isinstance(of, str) or name == "goal" and isinstance(of, bool):
                continue
            is_number = isinstance(of, (int, float)) and not isinstance(of, bool)
            if name in ("name", "goal") or not (is_number or of is None and name != "stack"):
                expected = {"name": "the name of one", "goal": "True or False"}.get(name, "a number")
                raise TypeError(f"observation: {name} is {shown(of)}; expected {expected}")
        _evodrive.observed(self._plain())

    def _plain(self) -> dict[str, Any]:
        return {name: of.item() if isinstance(of, np.generic) else of for name, of in asdict(self).items()}


class Seen:
    """What an observation is: its space, and how what the engine writes is looked at."""

    def __init__(self, given):
        if isinstance(given, Mapping):  # of a spec that was JSON
            given = Observation(**given)
        of = Observation(given) if isinstance(given, str) else given
        if not isinstance(of, Observation):
            raise TypeError(f"observation is {shown(given)}; expected a name, or evodrive.gym.Observation")
        self.plain, self.stack = of._plain(), int(of.stack)
        standard, low, high, parts = _evodrive.observed(self.plain)
        #: The name, of a standard one.
        self.name = of.name if standard else None
        #: As it is called.
        self.said = of.name if standard else repr(of)
        self.width = len(low) * self.stack
        low, high = np.float32(low), np.float32(high)
        stacked = lambda bound, shape: np.array(np.broadcast_to(bound.reshape(shape), (self.stack, *shape)) if self.stack > 1 else bound.reshape(shape))
        box = lambda of, shape: spaces.Box(stacked(low[of], shape), stacked(high[of], shape), dtype=np.float32)
        self.cuts, at = {}, 0
        for name, rows, each in parts:
            shape = (rows, each) if rows else (each,)
            count = max(rows, 1) * each
            self.cuts[name] = slice(at, at + count), shape
            at += count
        self.space = spaces.Dict({name: box(*of) for name, of in self.cuts.items()}) if parts else box(slice(None), low.shape)

    def views(self, sheet):
        """Rows of the engine's as the space has them: themselves, or a dictionary of views of them."""
        sheet = sheet.reshape(len(sheet), *([self.stack] if self.stack > 1 else []), self.width // self.stack)
        if not self.cuts:
            return sheet
        return {name: sheet[..., of].reshape(*sheet.shape[:-1], *shape) for name, (of, shape) in self.cuts.items()}


def standard(observation):
    """The name of a standard observation; others are refused, for weights and programs' drivers know no others."""
    seen = Seen(observation)
    if seen.name is None:
        raise ValueError(
            f"{seen.said} is no standard observation, and a file of weights knows only these; expected metadrive-1, safebench-1 or "
            "safebench-2, or evaluate(policy, scenes, observation=...) of a function or module, which drives within this process"
        )
    return seen.name
