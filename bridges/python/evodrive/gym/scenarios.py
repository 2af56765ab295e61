"""Scenes and the programs that change them."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from .. import _evodrive
from ..shown import shown

Path_ = str | os.PathLike[str]

#: How an episode ended, by the number in `info["end"]`; -1 while it goes on.
ENDS = ("contact", "off_road", "arrived", "horizon")
#: What a contact was like, by the number in `info["contact_class"]`; -1 without one.
CONTACT_CLASSES = (
    "ego_strikes", "ego_sideswipes", "stationary_hit", "cut_in", "crossing", "head_on", "sideswipe", "rear_end_ego_struck"
)  # fmt: skip

_DRIVERS = ("idm", "idm-lights", "pdm", "frenet", "replay")


def _paths(of):
    return [os.fspath(path) for path in ([of] if isinstance(of, (str, os.PathLike)) else of or [])]


def generate(path: Path_, count: int, seed: int, protocol: str = "metadrive") -> Path_:
    """Writes a pool of generated scenes and gives its path. `protocol`: "metadrive" (crossings, merges, roundabouts and the like, with
    their traffic) or "safebench" (its traffic families on generated roads; count has no meaning there)."""
    from ..runs import command

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scenes.toml"
        counted = f"count = {int(count)}\n" if protocol == "metadrive" else ""
        head = f'base = "evodrive:{protocol}"\nname = "scenes"\ndescribes = "scenes to train in"\ncassette = "none.jsonl"\n'
        family = "cat" if protocol == "metadrive" else "human"
        lineage = f'[[lineage]]\nid = "{family}"\nfamily = "{family}"\nego = "idm"\n'
        file.write_text(f"{head}[scenes]\n{counted}seed = {int(seed)}\n{lineage}")
        command("scenes", "generate", file, "--out", Path(path).absolute())
    return path


class HeldOut:
    """The held-out scenes of `Scenarios`: nothing is trained in them, `evodrive.gym.evaluate` drives them."""

    def __init__(self, scenarios: Scenarios) -> None:
        self.scenarios = scenarios

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def ids(self) -> list[str]:
        """Ids of the scenes."""
        return self.scenarios._native.held_out

    def __repr__(self) -> str:
        return f"HeldOut({len(self)} scenes)"


class Scenarios:
    """Scenes, as they are and as programs change them, and which of both come up how often.

    pool          a pool, a scenario file or a folder of them, or a list of these
    programs      name -> program file (`evodrive program export`), name of a family (its published parent), or None for the
                  scenes as they are; without it {"plain": None}
    mix           name -> share, on any scale; without it all alike
    plan_around   around whose drive a program plans its adversaries: "idm", "idm-lights", "pdm", "frenet", "replay", a file of weights, or
                  "policy": the one that is being trained (`env.policy = ...`), every `replan_every` steps
    replan_every  steps of the environment, all its places together, between two plans around the policy
    held_out      scenes that are never trained in; a scene of both is refused
    plant         the simulator's law of motion: "physical" or "metadrive-0.4.3"; without it that of the programs
    threads       for reading and planning; 0 is one a core
    """

    def __init__(
        self,
        pool: Path_ | Sequence[Path_],
        programs: Mapping[str, Path_ | None] | None = None,
        mix: Mapping[str, float] | None = None,
        plan_around: Path_ = "idm",
        replan_every: int | None = None,
        held_out: Path_ | Sequence[Path_] | None = None,
        plant: str | None = None,
        threads: int = 0,
    ) -> None:
        programs = {"plain": None} if programs is None else {name: None if of is None else os.fspath(of) for name, of in programs.items()}
        if not programs:
            raise ValueError("programs is empty; expected a name and a program file, or a name and None for the scenes as they are")
        is_policy = plan_around == "policy"
        if is_policy and not (isinstance(replan_every, int) and replan_every > 0):
            raise ValueError(f"replan_every is {shown(replan_every)}; plan_around='policy' needs a number of steps, e.g. 200_000")
        if replan_every is not None and not is_policy:
            raise ValueError("replan_every goes with plan_around='policy'; other drivers do not change")
        plan_around = os.fspath(plan_around)
        self.plan_around, self.replan_every, self.threads = plan_around, replan_every, threads
        self._driver = _driver("idm" if is_policy else plan_around)
        self.pool, self.plant = _paths(pool), plant
        self.held_out_pool = _paths(held_out)
        shares = _shares(mix, programs)
        listed = [(name, of, shares[name]) for name, of in programs.items()]
        self._hold(_evodrive.Scenarios(self.pool, listed, self.held_out_pool, plant, threads), programs, shares)

    def _hold(self, native, programs, shares):
        self._native, self.held_out = native, HeldOut(self)
        self._ids, self._names = native.scenes, native.programs
        # Views: who changes the mix of a training calls `set_mix` of the environment.
        self._programs, self._mix = MappingProxyType(programs), MappingProxyType(shares)

    def _with(self, mix, programs):
        """The same scenes under another mix, and with further programs."""
        new = {name: None if of is None else os.fspath(of) for name, of in programs.items()}
        known = {**self.programs, **new}
        shares = _shares(mix, known)
        listed = [(name, of, shares[name], name in new) for name, of in known.items()]
        again = object.__new__(Scenarios)
        vars(again).update(vars(self))
        again._hold(self._native.with_programs(listed, self.plant), known, shares)
        return again

    @property
    def programs(self) -> Mapping[str, str | None]:
        """Name -> file, family or None."""
        return self._programs

    @property
    def mix(self) -> Mapping[str, float]:
        """Name -> share."""
        return self._mix

    @mix.setter
    def mix(self, _: Any) -> None:
        raise AttributeError("the mix of Scenarios does not change; call set_mix({'plain': 0.3, ...}) of the environment that drives them")

    @property
    def scenes(self) -> list[str]:
        """Ids of the scenes, by the number in `info["scene"]`."""
        return list(self._ids)

    @property
    def program_names(self) -> list[str]:
        """Names of the programs, by the number in `info["program"]`."""
        return list(self._names)

    def coverage(self, driver: Path_ | bytes | None = None) -> dict[str, dict[str, Any]]:
        """Of each program: in how many scenes it can be planned around a driver (without one that of `plan_around`), in how many
        of these it changes anything, and why not in the others."""
        told = self._native.coverage(*(self._driver if driver is None else _driver(driver)), self.threads)
        keys = ("planned", "acts", "reasons")
        return {name: dict(zip(keys, of)) for name, of in zip(self.program_names, told)}

    def __deepcopy__(self, _: Any) -> Scenarios:
        return self  # nothing about it changes

    def _plain(self) -> dict[str, Any]:
        """What it was made of."""
        around = {"plan_around": self.plan_around, "replan_every": self.replan_every, "plant": self.plant, "threads": self.threads}
        return {"pool": self.pool, "programs": dict(self.programs), "mix": dict(self.mix), "held_out": self.held_out_pool, **around}

    def __reduce__(self) -> tuple[Any, ...]:
        # Another process reads the files again.
        return _made, (self._plain(),)

    def __repr__(self) -> str:
        return f"Scenarios({len(self._ids)} scenes, programs {dict(self.mix)}, planned around {self.plan_around})"


def _made(given):
    return Scenarios(**given)


def _shares(mix, programs):
    """A share for each program; all alike without a mix."""
    mix = {name: 1.0 for name in programs} if mix is None else dict(mix)
    strange = set(mix) - set(programs)
    if strange:
        raise ValueError(f"mix names {sorted(strange)}, expected some of {sorted(programs)}")
    return {name: float(mix.get(name, 0.0)) for name in programs}


def _driver(of):
    """A driver as the compiled part takes it: its name, or the bytes of its weights."""
    if isinstance(of, (bytes, bytearray)):
        return None, bytes(of)
    if isinstance(of, str) and of in _DRIVERS:
        return of, None
    if isinstance(of, (str, os.PathLike)) and os.fspath(of).endswith((".safetensors", ".onnx")):
        with open(of, "rb") as file:
            return None, file.read()
    raise ValueError(f"no driver {shown(of)}; expected one of {', '.join(_DRIVERS)}, or a file of weights that ends in .safetensors or .onnx")
