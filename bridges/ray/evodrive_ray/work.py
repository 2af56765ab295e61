"""One shard on whatever machine Ray chose. The study and the shard come as bytes, the result goes back as bytes: machines
share no file system."""

import subprocess
import tempfile
from pathlib import Path

STUDY_FILES = ("experiment.toml", "scenes.pool", "rollouts.jsonl")


class Refused(Exception):
    """The command refused the shard: it would refuse it again."""


class Lost(Exception):
    """The worker was killed or wrote nothing: another try may do."""


def read_study(run):
    """The files that a worker needs of a run folder, by name."""
    return {name: (run / name).read_bytes() for name in STUDY_FILES if (run / name).is_file()}


def do_shard(name, shard, study, command, jobs):
    """The bytes of the result of a shard, given with its file name."""
    with tempfile.TemporaryDirectory(prefix="evodrive-") as folder:
        folder = Path(folder)
        for file, content in study.items():
            (folder / file).write_bytes(content)
        (folder / name).write_bytes(shard)
        arguments = [*command, "--jobs", str(jobs), "shard", "work", str(folder / name), "--study", str(folder), "--out", str(folder)]
        ended = subprocess.run(arguments, capture_output=True, text=True, check=False)
        said = ended.stderr.strip()[-2000:]
        if ended.returncode < 0:
            raise Lost(f"{name}: ended by signal {-ended.returncode}: {said}")
        if ended.returncode != 0:
            raise Refused(f"{name}: exit code {ended.returncode}: {said}")
        result = folder / Path(name).with_suffix(".result").name
        if not result.is_file():
            raise Lost(f"{name}: no result was written: {said}")
        return result.read_bytes()
