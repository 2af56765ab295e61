"""The compiled part of the package: `evodrive.gym` and `evodrive.runs` are its interface."""

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any

__version__: str

_Around = tuple[str | None, bytes | None]
# Of an environment of several agents: seed, episodes, and the scene's number with the actions of each step.
_Past = tuple[int, int, tuple[int, list[list[list[float]]]] | None]

def main(words: Sequence[str]) -> int:
    """Runs the program `evodrive` with these words (its own name first) and gives its exit code."""

def digest(bytes: bytes) -> str:
    """BLAKE3 of bytes: 64 hex digits."""

def observed(observation: Mapping[str, Any]) -> tuple[bool, list[float], list[float], list[tuple[str, int, int]]]:
    """Whether an observation is the standard one of its name; lowest and highest value of each number of one moment; and how one of
    "arrays-1" is cut: name, rows (0: a single one), numbers a row."""

def weights(
    observation: str, layers: Sequence[tuple[Sequence[Sequence[float]], Sequence[float]]], activation: str, squash: str
) -> bytes:
    """The bytes of a file of weights."""

def weights_observation(bytes: bytes) -> str:
    """The observation that a file of weights drives by."""

def evaluate(scenarios: Scenarios, name: str | None = None, weights: bytes | None = None, held_out: bool = True, threads: int = 0) -> str:
    """How a driver fares, by program, as JSON."""

def evaluate_by(
    scenarios: Scenarios, ask: Callable[[bytes, int], bytes], observation: Mapping[str, Any], held_out: bool, threads: int
) -> str:
    """The same of a policy within Python, which is asked for the actions of all scenes at once."""

def step_names() -> list[str]:
    """What the numbers of the array "step" are called."""

class Sheet:
    """An array of the engine's, for numpy."""

    @property
    def __array_interface__(self) -> dict[str, Any]: ...

class Scenarios:
    def __init__(
        self,
        pool: Sequence[str | PathLike[str]],
        programs: Sequence[tuple[str, str | PathLike[str] | None, float]],
        held_out: Sequence[str | PathLike[str]],
        plant: str | None,
        threads: int,
    ) -> None: ...
    def with_programs(self, programs: Sequence[tuple[str, str | None, float, bool]], plant: str | None) -> Scenarios: ...
    @property
    def scenes(self) -> list[str]: ...
    @property
    def held_out(self) -> list[str]: ...
    @property
    def programs(self) -> list[str]: ...
    @property
    def staged(self) -> bool: ...
    def coverage(self, name: str | None, weights: bytes | None, threads: int) -> list[tuple[int, int, list[str]]]: ...

class Shared:
    def __init__(
        self,
        scenarios: Scenarios,
        agents: int,
        others: str,
        observation: Mapping[str, Any],
        reward: str,
        motion: bool,
        state: _Past | None = None,
    ) -> None: ...
    def state(self) -> _Past: ...
    def reset(self, seed: int | None = None, scene: int | None = None) -> tuple[int, list[str], bytes]: ...
    def step(self, actions: Sequence[Sequence[float]]) -> tuple[bytes, list[tuple[float, int, int, float, int | None, list[float]]]]: ...
    def picture(self, agent: int, width: float, title: str) -> tuple[int, int, bytes]: ...

class Fleet:
    def __init__(
        self,
        scenarios: Scenarios,
        places: int,
        threads: int,
        observation: Mapping[str, Any],
        reward: str,
        autoreset: str,
        by_failure: float,
        ego: str | None,
        weights: bytes | None,
        preventable: bool,
        keep: bool,
        motion: bool,
        state: str | None = None,
    ) -> None: ...
    @property
    def threads(self) -> int: ...
    def state(self) -> tuple[str, _Around, _Around | None]: ...
    def take(self, scenarios: Scenarios) -> None: ...
    def set_autoreset(self, autoreset: str) -> None: ...
    def weights(self) -> list[float]: ...
    def seed(self, seeds: Sequence[tuple[int, int]]) -> None: ...
    def reset(self, mask: Sequence[bool] | None = None, task: tuple[int, int] | None = None) -> int: ...
    def step(self) -> tuple[int, int]: ...
    def array(self, name: str) -> Sheet: ...
    def plan_around(self, name: str | None = None, weights: bytes | None = None) -> None: ...
    def adopt(self) -> bool: ...
    def kept(self, place: int) -> str | None: ...
    def picture(self, place: int, width: float, title: str) -> tuple[int, int, bytes]: ...
    def close(self) -> None: ...
