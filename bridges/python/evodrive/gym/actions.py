"""Actions by number, for learners that choose among a few."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from ..shown import shown

#: Most values of one, and most rows of a table.
_MOST = 1000


@dataclass(frozen=True)
class Discrete:
    """Actions by number, as of MetaDrive's `discrete_action`: evenly spaced values from -1 to 1 of steering and pedal.

    steering  number of its values (MetaDrive's `discrete_steering_dim`); an odd one has 0 among them
    pedal     number of its values (`discrete_throttle_dim`)
    multi     with True the space is MultiDiscrete([steering, pedal]) (`use_multi_discrete`); without it Discrete(steering * pedal), of which
              action i is steering value i % steering and pedal value i // steering, as there
    table     in place of all these: rows of steering and pedal from -1 to 1, of which action i is row i
    """

    steering: int = 5
    pedal: int = 5
    multi: bool = False
    table: Sequence[Sequence[float]] | None = None

    def __post_init__(self) -> None:
        for name in ("steering", "pedal"):
            of = getattr(self, name)
            if isinstance(of, bool) or not isinstance(of, (int, np.integer)) or not 2 <= of <= _MOST:
                raise ValueError(f"Discrete: {name} is {shown(of)}; expected a number of values from 2 to {_MOST}")
        if not isinstance(self.multi, bool):
            raise ValueError(f"Discrete: multi is {shown(self.multi)}; expected True or False")
        if self.table is None:
            return
        if self.multi:
            raise ValueError("Discrete: multi goes with steering and pedal; a table has one number a row")
        try:
            rows = np.array(self.table, np.float32)
        except (TypeError, ValueError):
            rows = np.zeros(0)
        if rows.ndim != 2 or rows.shape[1] != 2 or not 1 <= len(rows) <= _MOST or not (np.abs(rows) <= 1.0).all():
            raise ValueError(
                f"Discrete: the table is {shown(self.table)}; expected 1 to {_MOST} rows of steering and pedal, numbers from -1 to 1"
            )
        # Hashable, and nobody's list.
        object.__setattr__(self, "table", tuple(tuple(row) for row in rows.tolist()))

    def _plain(self) -> dict[str, Any]:
        if self.table is not None:
            return {"table": [list(row) for row in self.table]}
        return {"steering": int(self.steering), "pedal": int(self.pedal), "multi": self.multi}


class Actions:
    """What an environment takes as an action: without `Discrete` steering and pedal themselves, float32 (2,)."""

    def __init__(self, given):
        if isinstance(given, Mapping):  # of a spec that was JSON
            given = Discrete(**given)
        if given is not None and not isinstance(given, Discrete):
            raise TypeError(f"actions is {shown(given)}; expected evodrive.gym.Discrete, or None for steering and pedal from -1 to 1")
        self.given = given
        if given is None:
            self.space, self.said = spaces.Box(-1.0, 1.0, (2,), np.float32), "steering and pedal"
            return
        if given.table is not None:
            self.rows = np.array(given.table, np.float32)
        else:
            steering, pedal = (np.linspace(-1.0, 1.0, count, dtype=np.float32) for count in (given.steering, given.pedal))
            self.rows = np.stack([np.tile(steering, len(pedal)), np.repeat(pedal, len(steering))], 1)
        if given.multi:
            self.space, self.said = spaces.MultiDiscrete([given.steering, given.pedal]), "the numbers of steering and pedal"
        else:
            self.space, self.said = spaces.Discrete(len(self.rows)), "a number"

    def driven(self, actions, who, is_read=None):
        """Steering and pedal of actions, a row each; those that nobody reads may be anything. `who` names a row in front of what is wrong."""
        if self.given is None:
            return actions
        if actions.dtype.kind not in "iu":
            raise TypeError(f"actions are of {actions.dtype}; expected whole numbers: {self.said} each")
        counts = self.space.nvec if self.given.multi else len(self.rows)
        actions = actions.astype(np.int64)
        odd = (actions < 0) | (actions >= counts)
        if is_read is not None:
            odd &= is_read[:, None] if self.given.multi else is_read
        if odd.any():
            row, *which = np.argwhere(odd)[0]
            below = counts[which[0]] if self.given.multi else counts
            of = f"action[{which[0]}]" if self.given.multi else "the action"
            raise ValueError(f"{who(row)}{of} is {actions[(row, *which)]}; expected a number from 0 to {below - 1}")
        if self.given.multi:
            actions = actions[:, 0] + actions[:, 1] * self.given.steering
        return self.rows.take(actions, 0, mode="clip")
