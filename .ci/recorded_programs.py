"""What the tables of recorded programs share: the program of every lineage of a run with its held-out scenes as files, and cells."""
import json
import pathlib
import subprocess
import sys


HOME = pathlib.Path(__file__).resolve().parent.parent


class Evodrive:
    def __init__(self, binary):
        self.binary = binary

    def __call__(self, *words):
        ran = subprocess.run([self.binary, *map(str, words)], cwd=HOME, capture_output=True, text=True)
        if ran.returncode:
            sys.exit(f"evodrive {' '.join(map(str, words))}: {ran.stderr}")
        return ran.stdout

    def tried(self, *words):
        """Whether it came to an end without an error."""
        return subprocess.run([self.binary, *map(str, words)], cwd=HOME, capture_output=True).returncode == 0

    def applied(self, program, held_out, *words):
        """The first table's rows of a program on its scenes."""
        return json.loads(self("--json", "apply", program, "--scenes", held_out, *words))["tables"][0]["rows"]

    def programs(self, run, scratch):
        """Lineage, program file and pool of the run's held-out scenes, lineage by lineage."""
        run, scratch = pathlib.Path(run).resolve(), pathlib.Path(scratch)
        for lineage in json.loads((run / "result.json").read_text())["result"]["lineages"]:
            own = f"{run.name}-{lineage['lineage']}"
            program, held_out = scratch / f"{own}.json", scratch / f"{own}.pool"
            self("program", "export", run, lineage["evolved"]["solution"], "--out", program)
            seed = json.loads(program.read_text())["conditions"]["seed"]
            self("scenes", "split", run / "scenes.pool", "--held-out", lineage["held_out_scenes"], "--seed", seed,
                 "--out", scratch / f"{own}-evolution.pool", "--held-out-to", held_out)
            yield lineage["lineage"], program, held_out


def finished(runs, name, experiment):
    """The folder of a finished run below another folder."""
    folders = sorted(runs.glob(f"{name}-????????"))
    if len(folders) != 1:
        sys.exit(f"{runs}: expected one finished run of {experiment}, found {len(folders)}; `evodrive run {experiment} --out {runs}` makes it")
    return folders[0]


def ours(row, key):
    return row["values"][key]["ours"]


def cell(of):
    interval = of["interval"]
    return f"{of['value']:.3f}" + (f" [{interval[0]:.3f}, {interval[1]:.3f}]" if interval else "")
