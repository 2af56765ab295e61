"""The rounds of a study: plan, distribute, try again, merge, until nothing is missing; then the run. Who schedules is a crew: `on_ray`
and `on_slurm`. evodrive decides what a result is worth."""

import argparse
import hashlib
import json
import os
import resource
import shutil
import sys
import time
import tomllib
from collections import Counter, defaultdict, deque
from dataclasses import dataclass
from pathlib import Path

from .bundle import study_files
from .command import Evodrive, Failed
from .line import Line, told
from .place import place, write_new, write_whole

DIVERGED = 4
REFUSALS = (0, 2, 4, 5)
# How long what a killed driver left under way may take to end.
BUSY_S, BUSY_MAX = 1.0, 120
REFUSED = "refused"
MERGED = "merged"


@dataclass
class Shard:
    """A piece of work by its file."""

    path: Path
    name: str

    @property
    def digest(self):
        return self.path.stem

    @property
    def lineage(self):
        return self.name.split(" ")[0]

    @property
    def result(self):
        return self.path.with_suffix(".result")


@dataclass
class Event:
    """What became of a shard that was under way: `done`, `lost` (another try may do), `busy` (what a killed try left has not ended yet),
    `lacking` (another machine may do) or `refused`."""

    shard: Shard
    kind: str
    node: str = ""
    said: str = ""
    # The result, where it comes this way and does not lie at the place of results.
    content: bytes = None
    # Seconds of the work itself, and of its CPU; when it began, by the machine's own clock.
    seconds: float = 0.0
    cpu_s: float = 0.0
    began: float = 0.0


class Stopped(SystemExit):
    """The study cannot go on; the text says why and what helps."""


def common_options(parser):
    parser.add_argument("--out", default="runs", help="folder for run folders (default: runs)")
    parser.add_argument("--evodrive", default="evodrive", help="the binary; it travels to the workers (default: evodrive of the PATH)")
    parser.add_argument("--installed", metavar="COMMAND", help="use this command on the workers; no binary travels")
    parser.add_argument("--workers", type=int, metavar="N", help="shards under way at once (default: as many as there is room for)")
    parser.add_argument("--cpus", type=int, default=1, help="CPUs of a shard, and threads in it (default: 1)")
    parser.add_argument("--by", choices=["auto", "lineage", "task"], default="auto", help="one shard for all that follows in a lineage, or "
                        "shards of tasks; auto takes tasks where workers are more than twice as many as lineages")
    parser.add_argument("--size", type=int, default=64, help="most tasks in a shard (default: 64)")
    parser.add_argument("--results", metavar="ADDRESS", help="where workers write results: a shared folder or an address of fsspec, "
                        "e.g. s3://bucket/study")
    parser.add_argument("--retries", type=int, default=3, help="how often a shard is tried again that was lost (default: 3)")
    parser.add_argument("--audit", type=float, metavar="SHARE", help="compute this share of what comes back again, here")
    parser.add_argument("--record", action="store_true", help="ask the experiment's models for what its cassette lacks")
    parser.add_argument("--open", type=int, metavar="N", help="with --record: questions that a worker, or the plan, has open together")
    parser.add_argument("--rounds", type=int, default=1000, help="most rounds; the run computes what is still missing (default: 1000)")
    parser.add_argument("--no-report", action="store_true", help="write no report.html at the end")
    parser.add_argument("--resume", action="store_true", help="go on where a driver was killed, with the options that it had")


def parsed(name, about, more):
    """The options of a command `NAME run EXPERIMENT`."""
    parser = argparse.ArgumentParser(prog=name, description=about)
    run = parser.add_subparsers(dest="command", required=True).add_parser("run", help="do a study on the cluster, to its end")
    run.add_argument("experiment", help="experiment file")
    common_options(run)
    more(run)
    return parser.parse_args()


class Driver:
    """A study under way."""

    def __init__(self, options, crew_of):
        self.options, self.crew_of = options, crew_of
        self.line = Line()
        self.evodrive = Evodrive([options.evodrive])
        self.made_by, self.refusals = {}, Counter()
        self.rounds_done, self.by = 0, options.by
        self.counts = Counter()
        self.times = {"rounds": []}
        # Machines that lack what the study's shards need.
        self.lacking = set()
        # Seconds of a lineage's last shard.
        self.took = {}

    # The rounds.

    def conduct(self):
        """Carries the study to its end: the exit code."""
        began = time.monotonic()
        self.guard()
        vain = 0
        for number in range(1, self.options.rounds + 1):
            planned, *plan_s = timed(self.plan)
            if number == 1:
                self.open(planned)
            self.times["rounds"].append({"plan_s": plan_s, "work_wall_s": 0.0, "merge_s": [0.0, 0.0], "shards": []})
            if planned["complete"]:
                break
            before = self.counts["records"]
            shards = [Shard(Path(path), name) for path, name in zip(planned["to_do"], planned["names"])]
            _, self.times["rounds"][-1]["work_wall_s"], _ = timed(lambda: self.round(number, shards))
            _, *self.times["rounds"][-1]["merge_s"] = timed(self.merge)
            self.rounds_done = number
            # The results of a driver that was killed behind its merge are known by now.
            vain = vain + 1 if self.counts["records"] == before and not self.again else 0
            if vain > 1:
                raise Stopped("a round brought nothing: the plan asks for what its results do not hold; please report this with the run folder")
        self.close()
        spent = time.monotonic() - began
        rounds = "1 round" if self.rounds_done == 1 else f"{self.rounds_done} rounds"
        self.line.say(f"{rounds}, {self.counts['shards']} shards, {self.counts['lost']} lost and tried again, "
                      f"{self.counts['refused']} results refused, {spent:.0f} s; now the run, from records")
        words = ["record" if self.options.record else "run", self.options.experiment, "--out", self.options.out]
        code, *finish_s = timed(lambda: self.evodrive.shown(*words, *(["--no-report"] if self.options.no_report else [])))
        workers = self.crew_of.room(self.options)
        self.times |= {"workers": workers, "finish_s": finish_s, "wall_s": time.monotonic() - began, "epochs": self.epochs()}
        write_whole(self.shards / "times.json", json.dumps(self.times, indent=1).encode())
        return code

    def epochs(self):
        """How many epochs the study has."""
        return self.settings()["budget"]["epochs"]

    def plan(self):
        whole = self.by != "task"
        planned = self._plan(whole)
        if self.by == "auto" and not planned["complete"]:
            lineages = planned["lineages"]
            # Where scenes without a program come first nothing is known of lineages yet.
            if lineages:
                self.by = "task" if self.crew_of.room(self.options) > 2 * lineages else "lineage"
                if self.by == "task":
                    return self._plan(False)
        return planned

    def _plan(self, whole):
        options = self.options
        words = ["shard", "plan", *self.target(), "--size", str(options.size)]
        words += ["--whole-lineages"] if whole else []
        words += ["--record"] if options.record else []
        words += ["--open", str(options.open)] if options.open else []
        return self.evodrive.json(*words)[0]

    def target(self):
        """The run as its commands are named it: by its folder once that is there, which spares making or reading the scenes anew. Rollouts
        of another simulator are kept beside the experiment file, so there that one is named."""
        folder = getattr(self, "run", None)
        if folder is None or (self.settings().keys() & {"driver"}) or "backend" in self.settings().get("simulator", {}):
            return [self.options.experiment, "--out", self.options.out]
        return [str(folder)]

    def settings(self):
        with (self.run / "experiment.toml").open("rb") as file:
            return tomllib.load(file)

    def round(self, number, shards):
        if not shards:
            return
        self.collect(shards)
        done, began = 0, time.monotonic()
        tries, busy, avoid = Counter(), Counter(), defaultdict(set)
        # The longest first, by what their lineages took before: nobody waits for one that was begun last.
        shards = sorted(shards, key=lambda shard: -self.took.get(shard.lineage, float("inf")))
        waiting = deque(shard for shard in shards if not shard.result.exists())
        done = len(shards) - len(waiting)
        at_begin = done
        under_way = 0
        for shard in waiting:
            # Whoever made a refused result gets no second chance with its shard.
            if self.refusals[shard.digest] and shard.digest in self.made_by:
                avoid[shard.digest].add(self.made_by[shard.digest])
        while waiting or under_way:
            while waiting and under_way < self.crew.at_once():
                shard = waiting.popleft()
                tries[shard.digest] += 1
                self.crew.submit(shard, tries[shard.digest], avoid[shard.digest] | self.lacking)
                under_way += 1
            for event in self.crew.wait():
                under_way -= 1
                shard = event.shard
                log = self.log(shard, tries[shard.digest], event)
                if event.kind == "done":
                    self.keep(event)
                    self.took[shard.lineage] = event.seconds
                    self.times["rounds"][-1]["shards"].append({"name": shard.name, "work_s": [event.seconds, event.cpu_s],
                                                               "began": event.began, "node": event.node})
                    done += 1
                    self.counts["shards"] += 1
                    continue
                if event.kind == "busy" and busy[shard.digest] < BUSY_MAX:
                    busy[shard.digest] += 1
                    tries[shard.digest] -= 1
                    waiting.append(shard)
                    time.sleep(BUSY_S)
                    continue
                self.counts["lost"] += 1
                if event.kind in ("lost", "busy") and tries[shard.digest] <= self.options.retries:
                    self.line.say(f"lost, tried again: {shard.name}: {short(event.said)}")
                elif event.kind == "lacking" and event.node and self.crew.has_others(avoid[shard.digest] | self.lacking | {event.node}):
                    # All shards of a study need the same.
                    self.lacking.add(event.node)
                    self.line.say(f"{event.node} lacks what {shard.name} needs, it goes elsewhere: {short(event.said)}")
                else:
                    why = "there is no other machine that might have what this one lacks" if event.kind == "lacking" else "it was given up"
                    raise Stopped(f"{shard.name}: {why}: {event.said.strip()}\n  log: {log}\n  to go on: repeat the command with --resume")
                waiting.append(shard)
            seconds = time.monotonic() - began
            self.line.show(told(number, done, len(shards), under_way, seconds) if done == at_begin else
                           told(number, done, len(shards), under_way, seconds * done / (done - at_begin)))
        self.line.show(told(number, done, len(shards), 0, time.monotonic() - began), now=True)

    def merge(self):
        """Merges, and takes out what cannot be used: its shards are done again, elsewhere."""
        options, self.again = self.options, False
        words = ["shard", "merge", *self.target()]
        try:
            share = [] if options.audit is None else ["--audit", str(options.audit)]
            merged, _ = self.evodrive.json(*words, *share, may=REFUSALS)
        except Failed as failed:
            if failed.code != DIVERGED:
                raise
            # Two results of one request: who is wrong shows when both are computed again here.
            self.line.say(f"results differ, all of them are computed again: {short(failed.said)}")
            merged, _ = self.evodrive.json(*words, "--audit", "1", may=REFUSALS)
        self.counts["records"] += sum(merged[of] for of in ("records", "answers", "no_label", "asked"))
        for result, why in zip(merged["refused_results"], merged["refused"]):
            self.refuse(Path(result), why)
        # What is part of the run need not be read with every round.
        merged_here = self.shards / MERGED
        merged_here.mkdir(exist_ok=True)
        for result in self.shards.glob("*.result"):
            result.replace(merged_here / result.name)

    def refuse(self, result, why):
        digest = result.stem
        node = self.made_by.get(digest, "an unknown machine")
        self.again = True
        self.counts["refused"] += 1
        self.refusals[digest] += 1
        aside = self.shards / REFUSED
        aside.mkdir(exist_ok=True)
        result.replace(aside / f"{result.name}.{self.refusals[digest]}")
        if self.results is not None:
            self.results.remove(result.name)
        self.line.say(f"refused, made by {node}: {why}")
        if self.refusals[digest] > self.options.retries:
            raise Stopped(f"the result of {digest} was refused {self.refusals[digest]} times; they lie in {aside}")

    # What comes and goes.

    def open(self, planned):
        """The run's folder is known with the first plan."""
        self.run, self.shards = Path(planned["folder"]), Path(planned["shards"])
        (self.shards / "logs").mkdir(parents=True, exist_ok=True)
        self.results = place(self.options.results) if self.options.results else None
        files = study_files(self.run)
        if self.options.installed is None:
            binary = shutil.which(self.options.evodrive)
            if binary is None:
                raise Stopped(f"--evodrive {self.options.evodrive}: no such program")
            files["evodrive"] = Path(binary).read_bytes()
        self.crew = self.crew_of(self.options, files, self.shards)

    def guard(self):
        """One driver a run folder. One that was killed left its file."""
        path = driver_file(self.options)
        path.parent.mkdir(parents=True, exist_ok=True)
        own = json.dumps({"pid": os.getpid(), "started": started(os.getpid()), "host": os.uname().nodename, "options": saved(self.options)}).encode()
        while not write_new(path, own):
            # Of several that find the file of a killed one, each takes away what it looked at alone.
            aside = path.with_name(f"{path.name}.{os.getpid()}")
            try:
                other = json.loads(path.read_text())
                if other["host"] == os.uname().nodename and is_alive(other["pid"], other["started"]):
                    raise Stopped(f"another driver (process {other['pid']}) is at work on {self.options.experiment}")
                path.rename(aside)
            except FileNotFoundError:
                continue
            taken = aside.read_bytes()
            aside.unlink()
            if json.loads(taken) != other:
                write_new(path, taken)

    def close(self):
        if hasattr(self, "crew"):
            self.crew.close()
        driver_file(self.options).unlink(missing_ok=True)
        self.line.end()

    def collect(self, shards):
        """Takes what workers wrote for a driver that is no more."""
        if self.results is None:
            return
        there = self.results.names()
        for shard in shards:
            if shard.result.name in there and not shard.result.exists():
                write_whole(shard.result, self.results.read(shard.result.name))

    def keep(self, event):
        shard = event.shard
        self.made_by[shard.digest] = event.node
        if event.content is not None:
            write_whole(shard.result, event.content)
        elif not shard.result.exists():
            write_whole(shard.result, self.results.read(shard.result.name))

    def log(self, shard, number, event):
        path = self.shards / "logs" / f"{shard.digest[:16]}-{number}.log"
        path.write_text(f"{shard.name}, try {number}, {event.node}: {event.kind}\n{event.said}\n", errors="replace")
        return path


def timed(act):
    """What comes of it, in how many seconds, and in how many of CPU of the commands that it called."""
    began, before = time.monotonic(), cpu_s()
    return act(), time.monotonic() - began, cpu_s() - before


def cpu_s():
    of = resource.getrusage(resource.RUSAGE_CHILDREN)
    return of.ru_utime + of.ru_stime


def short(said):
    """The last line of what was said."""
    lines = [line for line in said.strip().splitlines() if line.strip()]
    return lines[-1][-400:] if lines else "nothing was said"


def driver_file(options):
    """Which driver is, or was, at work on an experiment."""
    name = hashlib.blake2b(str(Path(options.experiment).resolve()).encode(), digest_size=6).hexdigest()
    return Path(options.out) / f".driver-{name}.json"


def saved(options):
    return {name: value for name, value in vars(options).items() if name not in ("command", "resume")}


def started(pid):
    """When a process began, in the kernel's ticks: numbers of processes are used again."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[19]
    except (OSError, IndexError):
        return ""


def is_alive(pid, when):
    return when != "" and started(pid) == when


def resumed(options):
    """The options that a killed driver had, where it is gone on with."""
    if not options.resume:
        return options
    path = driver_file(options)
    if not path.exists():
        return options
    before = json.loads(path.read_text())["options"]
    # Paths on the command line are those of now.
    kept = {"experiment": options.experiment, "out": options.out, "evodrive": options.evodrive, "resume": True, "command": "run"}
    return argparse.Namespace(**{**vars(options), **before, **kept})


def carry_out(options, crew_of):
    """The exit code of a command."""
    driver = Driver(options, crew_of)
    try:
        return driver.conduct()
    except Failed as failed:
        driver.line.end()
        print(failed.said, file=sys.stderr)
        return failed.code if 0 < failed.code < 256 else 70
    except Stopped as stopped:
        driver.line.end()
        print(stopped, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        driver.line.end()
        print("stopped; results that came are kept: repeat the command with --resume", file=sys.stderr)
        return 130
    finally:
        if hasattr(driver, "crew"):
            driver.crew.close()
