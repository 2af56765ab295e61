"""Shards as tasks of Slurm's job arrays. The run folder lies on a file system that all machines see; binary and study are copied to each
machine once. Options of sbatch stand behind `--`."""

import itertools
import os
import subprocess
import sys
import time
from pathlib import Path

from .bundle import digest_of, write_whole_folder
from .conduct import Event, Stopped, carry_out, parsed, resumed
from .work import LACKING, LOCKED

SECONDS = 1.0
# Statuses are written before a task leaves the queue, but a shared file system may show them later.
PATIENCE_S = 20.0
TASK = Path(__file__).with_name("task.sbatch")


def said_by(*words, must=True, **variables):
    """What a command of Slurm says."""
    try:
        ended = subprocess.run(words, capture_output=True, text=True, check=False, env={**os.environ, **variables})
    except FileNotFoundError:
        raise Stopped(f"`{words[0]}` is not installed here: evodrive-slurm runs where jobs can be submitted") from None
    if ended.returncode != 0 and must:
        raise Stopped(f"`{' '.join(words)}` ended with {ended.returncode}: {ended.stderr.strip()}")
    return ended.stdout


class Slurm:
    """The crew."""

    @staticmethod
    def room(options):
        """How many shards can be under way at once: the CPUs that Slurm has, allocated, idle and in all."""
        if options.workers is not None:
            return options.workers
        cpus = said_by("sinfo", "--noheader", "--format=%C", must=False).split("/")
        return max(1, int(cpus[3]) // options.cpus) if len(cpus) == 4 and cpus[3].strip().isdigit() else 500

    def __init__(self, options, files, shards):
        self.options, self.logs = options, shards / "logs"
        self.jobs = shards / "jobs"
        self.bundle = shards / "travel" / digest_of(files)
        if not self.bundle.is_dir():
            write_whole_folder(self.bundle, files)
        changed = [name for name, content in files.items() if not (self.bundle / name).is_file() or (self.bundle / name).read_bytes() != content]
        if changed:
            raise Stopped(f"{self.bundle / changed[0]} is not what the folder's name says; remove {self.bundle} and repeat the command with --resume")
        self.waiting, self.under_way, self.gone_since = [], {}, {}
        self.numbers = itertools.count()
        self.end_others()

    def end_others(self):
        """Ends jobs of a driver that is no more. What they had done stays, and their shards go on from it."""
        if self.jobs.exists():
            for job in self.jobs.read_text().split():
                said_by("scancel", job, must=False)
            self.jobs.unlink()

    def at_once(self):
        # The array itself holds tasks back.
        return self.options.array_max

    def submit(self, shard, _number, avoid):
        self.waiting.append((shard, tuple(sorted(avoid))))

    def wait(self):
        self.send()
        time.sleep(SECONDS)
        queued = None
        for task, shard in list(self.under_way.items()):
            status = self.logs / f"{task}.status"
            if not status.exists():
                queued = self.queued() if queued is None else queued
                if task in queued or not self.is_gone(task):
                    continue
            self.under_way.pop(task)
            yield self.event(shard, task, status)

    def send(self):
        """Makes arrays of what waits. An array holds its own tasks back, but two of them know nothing of each other: beside one that is
        under way only so many tasks are sent as are free of `--workers`."""
        held = []
        for avoid, group in itertools.groupby(sorted(self.waiting, key=lambda of: of[1]), key=lambda of: of[1]):
            group = list(group)
            free = len(group)
            if self.options.workers and self.under_way:
                free = max(0, self.options.workers - len(self.under_way))
            if group[:free]:
                self.array([shard for shard, _ in group[:free]], avoid)
            held += group[free:]
        self.waiting = held

    def event(self, shard, task, status):
        log = self.logs / f"{task}.log"
        said = log.read_text(errors="replace")[-4000:] if log.exists() else ""
        if not status.exists():
            # Killed, or its machine was.
            if shard.result.exists():
                return Event(shard, "done", "", said)
            return Event(shard, "lost", "", f"{said}\ntask {task} is no more in the queue and wrote no status")
        code, seconds, cpu_s, began, node = status.read_text().split(maxsplit=4)
        code, spent, node = int(code), (float(seconds), float(cpu_s), float(began)), node.strip()
        if code == 0 and shard.result.exists():
            return Event(shard, "done", node, said, None, *spent)
        if code == LACKING:
            return Event(shard, "lacking", node, said)
        if code != 0 and LOCKED in said:
            return Event(shard, "busy", node, said)
        if code == 0 or code > 128:
            return Event(shard, "lost", node, said or f"exit code {code}, and no result")
        return Event(shard, "refused", node, f"exit code {code}: {said}")

    def is_gone(self, task):
        """Whether a task has been out of the queue for so long that no status can be on its way."""
        return time.monotonic() - self.gone_since.setdefault(task, time.monotonic()) > self.options.patience

    def queued(self):
        """Tasks that wait or run."""
        jobs = sorted({task.split("_")[0] for task in self.under_way})
        said = said_by("squeue", "--noheader", "--array", "--format=%F_%K", f"--jobs={','.join(jobs)}", must=False)
        return set(said.split())

    def array(self, shards, avoid):
        at = self.logs / f"array-{os.getpid()}-{next(self.numbers)}.list"
        at.write_text("".join(f"{shard.path.resolve()}\t{shard.name}\n" for shard in shards))
        limit = f"%{self.options.workers}" if self.options.workers else ""
        words = ["sbatch", "--parsable", f"--array=0-{len(shards) - 1}{limit}", f"--cpus-per-task={self.options.cpus}",
                 "--job-name=evodrive", "--output=/dev/null", "--export=ALL"]
        words += [f"--exclude={','.join(avoid)}"] if avoid else []
        words += [*self.options.sbatch, str(TASK), str(at.resolve()), str(self.logs.resolve()), str(self.bundle.resolve())]
        handed = {"EVODRIVE_INSTALLED": self.options.installed, "EVODRIVE_OPEN": self.options.open}
        job = said_by(*words, **{name: str(value) for name, value in handed.items() if value}).strip().split(";")[0]
        with self.jobs.open("a") as jobs:
            jobs.write(f"{job}\n")
        self.under_way.update({f"{job}_{place}": shard for place, shard in enumerate(shards)})

    def has_others(self, avoid):
        return bool(set(said_by("sinfo", "--noheader", "--Node", "--format=%N", must=False).split()) - set(avoid))

    def close(self):
        if self.under_way:
            self.end_others()
        self.jobs.unlink(missing_ok=True)
        self.under_way = {}


def more(parser):
    parser.add_argument("--array-max", type=int, default=1000, help="most tasks of the arrays under way (default: 1000, Slurm's own limit)")
    parser.add_argument("--patience", type=float, default=PATIENCE_S, metavar="SECONDS",
                        help="how long a task that left the queue may owe its status (default: 20)")


def main():
    words, behind = sys.argv[1:], []
    if "--" in words:
        at = words.index("--")
        words, behind = words[:at], words[at + 1:]
    sys.argv[1:] = words
    options = parsed("evodrive-slurm", __doc__, more)
    options.sbatch = behind
    options = resumed(options)
    if options.results:
        raise SystemExit("--results: expected nothing: with Slurm results lie in the run folder, which all machines see")
    sys.exit(carry_out(options, Slurm))


if __name__ == "__main__":
    main()
