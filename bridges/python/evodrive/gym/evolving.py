"""Programs evolved against a policy: a run like any other, started from Python."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import _evodrive
from .policies import weights_of
from .scenarios import Scenarios
from .spaces import Observation


@dataclass(frozen=True)
class Evolved:
    """A program that a run chose: its file (a path, usable in `Scenarios(programs=...)`), and where it came from."""

    path: Path
    family: str
    solution: str  # its name in the run, e.g. cat-policy/e2s5; the family's parent where nothing better was found
    run: Path  # the run folder: report.html shows every proposal, evodrive.load(run) gives its tables
    parent: dict[str, float]  # attack and realism of the family's parent in the run's own held-out scenes
    evolved: dict[str, float]  # and of this program

    def __fspath__(self) -> str:
        return os.fspath(self.path)


def evolve(
    policy: Any,
    scenarios: Scenarios,
    families: Sequence[str] = ("cat",),
    proposer: str = "scripted",
    out: str | os.PathLike[str] = "evolved",
    name: str = "evolved",
    epochs: int = 4,
    slots: int = 6,
    observation: str | Observation = "metadrive-1",
    settings: dict[str, Any] | None = None,
    jobs: int = 0,
) -> list[Evolved]:
    """Evolves programs of these families against a policy in the scenes of the training, and gives them as program files.

    policy    a file of weights, or whatever `save_policy` takes
    proposer  "scripted" (rules in a language model's place), or the name of a model of `settings`
    out       folder for the experiment file, the run and the program files; name names all of them
    epochs    rounds of proposals, `slots` proposals each
    settings  keys of the experiment above these, e.g. {"budget.finalists": 2}

    A fifth of the scenes stays closed during the search and says what was reached; `scenarios.held_out` is not looked at.
    """
    from .. import runs

    if not isinstance(scenarios, Scenarios):
        raise TypeError(f"scenarios is a {type(scenarios).__name__}; expected Scenarios, whose training scenes are evolved on")
    if len(scenarios.pool) != 1:
        raise ValueError(f"the scenarios lie in {len(scenarios.pool)} places; expected one pool (`evodrive scenes merge` makes one)")
    folder = Path(out).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.toml"
    if file.exists():
        raise FileExistsError(f"{file} exists already; name another run: evolve(.., name=...)")
    weights = folder / f"{name}{'.onnx' if str(policy).endswith('.onnx') else '.safetensors'}"
    content = weights_of(policy, observation)
    if weights.exists() and weights.read_bytes() != content:
        raise FileExistsError(f"{weights} exists already and holds other weights; name another run: evolve(.., name=...)")
    weights.write_bytes(content)
    pool = Path(scenarios.pool[0]).absolute()
    words = ["init", name, "--scenes", pool, "--family", ",".join(families), "--epochs", epochs, "--slots", slots]
    runs.command(*words, cwd=folder)
    digest = _evodrive.digest(weights.read_bytes())
    learned = f'ego = "learned"\npolicy = {{ file = "{weights.name}", digest = "{digest}" }}'
    file.write_text(file.read_text().replace('ego = "idm"', learned).replace('-idm"', '-policy"'))
    keys = dict(settings or {})
    if proposer != "scripted":
        keys.setdefault("roles.actor", proposer)
        keys.setdefault("roles.repair", proposer)
    run = runs.record(file, out=folder / "runs", report=True, settings=keys, jobs=jobs)
    programs = []
    for of in run.result["lineages"]:
        solution = of["evolved"]["solution"]
        path = folder / f"{name}-{of['lineage']}.json"
        runs.command("program", "export", solution, "--run", run.folder, "--out", path)
        family = json.loads(path.read_text())["family"]
        figures = [of[who]["objectives"] for who in ("parent", "evolved")]
        programs.append(Evolved(path, family, solution, run.folder, *figures))
    return programs
