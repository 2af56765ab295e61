"""Runs: started by the binary, read from their folders."""

import json
import os
import subprocess
import sys
import tempfile
from functools import cached_property
from pathlib import Path

import pandas as pd

from .shown import shown


class EvodriveError(RuntimeError):
    """A command that failed: its exit code (docs/RUNS.md lists them) and what it said."""

    def __init__(self, code, message):
        super().__init__(message)
        self.code = code


def binary():
    """The words that start the program: what the environment variable EVODRIVE names, or the one that this package carries."""
    named = os.environ.get("EVODRIVE")
    return [named] if named else [sys.executable, "-m", "evodrive"]


def command(*words, cwd=None):
    """Carries a command out with --json and gives its object. Progress goes to standard error as it comes.

    Raises EvodriveError where it fails, with what it said."""
    typed = [*binary(), "--json", *map(str, words)]
    try:
        done = subprocess.run(typed, stdout=subprocess.PIPE, text=True, cwd=cwd)
    except OSError as error:
        raise EvodriveError(2, f"{typed[0]} cannot be started: {error}; correct the environment variable EVODRIVE") from error
    try:
        told = json.loads(done.stdout) if done.stdout.strip() else {}
    except json.JSONDecodeError as error:
        raise EvodriveError(done.returncode, f"{typed[0]} printed no JSON: {error}") from error
    if done.returncode != 0:
        raise EvodriveError(done.returncode, told.get("error", f"{' '.join(typed)} ended with {done.returncode}"))
    return told


def run(experiment, **options):
    """Replays an experiment from its cassette and gives the run.

    Options: `out` (folder for run folders), `scenes` (list of pools, files, folders), `cassette`, `settings` (a dictionary of
    keys above the file's, e.g. {"budget.slots": 8}), `report` (False: none is written), `jobs`."""
    return _carried_out("run", experiment, **options)


def record(experiment, fresh=False, overwrite=False, **options):
    """Asks the experiment's models for what the cassette lacks, writes it, and gives the run. Options as of `run`."""
    return _carried_out("record", experiment, flags={"--fresh": fresh, "--overwrite": overwrite}, **options)


def load(folder="runs"):
    """The run in a folder; of a folder of run folders the latest one that came to its end."""
    folder = Path(folder)
    latest = folder / "LATEST"
    if latest.exists():
        folder = folder / latest.read_text().strip()
    return Run(folder)


def _carried_out(verb, experiment, out="runs", scenes=(), cassette=None, settings=None, report=True, jobs=0, flags=None):
    words = [verb, experiment, "--out", out, "--jobs", jobs]
    for key, value in (settings or {}).items():
        words += ["--set", f"{key}={value if isinstance(value, str) else json.dumps(value)}"]
    words += ["--cassette", cassette] if cassette else []
    words += [] if report else ["--no-report"]
    words += [flag for flag, wanted in (flags or {}).items() if wanted]
    words += ["--scenes", *scenes] if scenes else []
    return Run(command(*words)["folder"])


class Run:
    """A finished run: its folder, and what the binary lays out of it."""

    def __init__(self, folder):
        self.folder = Path(folder)
        if not (self.folder / "run.json").exists():
            raise EvodriveError(2, f"{self.folder}: expected a run folder, found no run.json")

    def __repr__(self):
        return f"Run({str(self.folder)!r})"

    @cached_property
    def _result(self):
        path = self.folder / "result.json"
        if not path.exists():
            raise EvodriveError(2, f"{path}: expected a finished run, found no result; `evodrive resume {self.folder}` ends it")
        return json.loads(path.read_text())

    @property
    def root(self):
        """The digest that the run comes to, 64 hex digits."""
        return self._result["root"]

    @property
    def result(self):
        """What the run came to, as result.json has it: lineages, replay, exits."""
        return self._result["result"]

    def table(self, name):
        """A table of docs/BUNDLES.md as a data frame, its columns typed as the dictionary says; missing values are NA."""
        if name not in self._tables:
            raise EvodriveError(2, f"no table {shown(name)}, expected one of {', '.join(self._tables)}")
        return self._tables[name].copy()

    def attempts(self):
        """A row a proposal, however it ended."""
        return self.table("attempts")

    def labels(self):
        """A row a program in a scene: attack, realism, each diagnostic, contact."""
        return self.table("labels")

    def rollouts(self):
        """A row a rollout behind labels; `labels().merge(rollouts(), on="record")` joins them."""
        return self.table("rollouts")

    def dictionary(self):
        """What every column of every table means, its type and unit."""
        return self.table("dictionary")

    @cached_property
    def _tables(self):
        with tempfile.TemporaryDirectory() as scratch:
            command("data", self.folder, "--out", scratch)
            dictionary = pd.read_csv(Path(scratch) / "dictionary.csv", dtype=str, keep_default_na=False)
            kinds = {"boolean": "boolean", "integer": "Int64", "number": "Float64", "text": "string"}
            tables = {}
            for name, columns in dictionary.groupby("table", sort=False):
                dtypes = {row.column: kinds[row.type] for row in columns.itertuples()}
                tables[name] = pd.read_csv(Path(scratch) / f"{name}.csv", dtype=dtypes)
            return {**tables, "dictionary": dictionary}
