"""Spaces of observations and actions, with the bounds that the engine keeps to."""

import numpy as np
from gymnasium import spaces

from .. import _evodrive

OBSERVATIONS = ("metadrive-1", "safebench-1", "safebench-2", "arrays-1")


def action_space():
    """Steering (positive to the left) and pedal (positive: forwards), both from -1 to 1."""
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def observation_space(observation):
    """The space of an observation of one environment: a Box, of "arrays-1" a Dict of them."""
    low, high = (np.asarray(of, np.float32) for of in _evodrive.bounds(observation))
    if observation != "arrays-1":
        return spaces.Box(low, high, dtype=np.float32)
    return spaces.Dict({name: spaces.Box(low[of].reshape(shape), high[of].reshape(shape), dtype=np.float32) for name, of, shape in cuts()})


def cuts():
    """The arrays of "arrays-1": name, which of its numbers, shape."""
    at, cut = 0, []
    for name, rows, each in _evodrive.layout():
        shape = (rows, each) if rows else (each,)
        count = int(np.prod(shape))
        cut.append((name, slice(at, at + count), shape))
        at += count
    return cut


def views(sheet, observation):
    """An array of observations as the space has it: itself, or a dictionary of views of it."""
    if observation != "arrays-1":
        return sheet
    return {name: sheet[:, of].reshape(len(sheet), *shape) for name, of, shape in cuts()}
