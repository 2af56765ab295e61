"""Plans, does and merges the shards of a run until nothing is missing. Ray schedules; evodrive decides what a result is
worth: every result is held to its shard and its digests when it is merged."""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import ray

from .work import Lost, Refused, do_shard, read_study


def evodrive(command, *arguments):
    """What an evodrive command says as JSON, with its exit code."""
    ended = subprocess.run([*command, "--json", *arguments], stdout=subprocess.PIPE, text=True, check=False)
    if not ended.stdout.strip():
        sys.exit(f"evodrive {' '.join(arguments)} ended with {ended.returncode} and said nothing on standard output")
    said = json.loads(ended.stdout)
    if "error" in said:
        sys.exit(ended.returncode)
    return said, ended.returncode


def write_whole(path, content):
    """A file is there whole or not at all."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    part.write_bytes(content)
    part.replace(path)


def do_all(shards, run, options):
    """Does shards as Ray tasks, writes each result as it comes, and counts those that were given up."""
    # Retries are counted here and not by Ray, so that a shard that is refused is not sent again.
    resources = json.loads(options.resources)
    task = ray.remote(num_cpus=options.cpus, resources=resources, max_retries=0)(do_shard)
    study = ray.put(read_study(run))
    tries = {path: 0 for path in shards}
    waiting, under_way, done, given_up = list(shards), {}, 0, 0
    began = time.monotonic()
    while waiting or under_way:
        while waiting and len(under_way) < options.at_once:
            path = waiting.pop(0)
            tries[path] += 1
            jobs = max(1, int(options.cpus))
            under_way[task.remote(path.name, path.read_bytes(), study, options.evodrive, jobs)] = path
        ready, _ = ray.wait(list(under_way), num_returns=1)
        path = under_way.pop(ready[0])
        try:
            write_whole(path.with_suffix(".result"), ray.get(ready[0]))
            done += 1
        except (Lost, ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError, ray.exceptions.OutOfMemoryError) as lost:
            again = tries[path] <= options.retries
            cause = getattr(lost, "cause", lost)
            print(f"lost ({'tried again' if again else 'given up'}): {cause}", file=sys.stderr)
            if again:
                waiting.append(path)
            given_up += not again
        except Refused as refused:
            print(f"refused: {getattr(refused, 'cause', refused)}", file=sys.stderr)
            given_up += 1
        spent = time.monotonic() - began
        print(f"{done} of {len(shards)} shards, {len(under_way)} under way, {spent:.0f} s", file=sys.stderr)
    return given_up


def arguments():
    parser = argparse.ArgumentParser(prog="evodrive-ray", description=__doc__)
    parser.add_argument("run", help="experiment file or run folder")
    parser.add_argument("--out", default="runs", help="folder for run folders")
    parser.add_argument("--evodrive", nargs="+", default=["evodrive"], help="the command, on the driver and on every worker")
    parser.add_argument("--address", default=None, help="of a Ray cluster; without it one is started on this machine")
    parser.add_argument("--size", type=int, default=64, help="most tasks in a shard")
    parser.add_argument("--cpus", type=float, default=1, help="CPUs of a shard; a worker uses as many threads")
    parser.add_argument("--resources", default="{}", help='further resources of a shard as JSON, e.g. {"metadrive": 1}')
    parser.add_argument("--at-once", type=int, default=1000, help="most shards under way at once")
    parser.add_argument("--retries", type=int, default=3, help="how often a shard whose worker was lost is sent again")
    parser.add_argument("--rounds", type=int, default=1000, help="most rounds of plan, work and merge")
    parser.add_argument("--record", action="store_true", help="ask the experiment's models while planning")
    return parser.parse_args()


def main():
    options = arguments()
    target = [options.run, "--out", options.out]
    # A Ray of its own needs no dashboard.
    own = {"include_dashboard": False} if options.address is None else {}
    ray.init(address=options.address, log_to_driver=False, configure_logging=False, **own)
    for number in range(options.rounds):
        plan = ["shard", "plan", *target, "--size", str(options.size), *(["--record"] if options.record else [])]
        planned, _ = evodrive(options.evodrive, *plan)
        if planned["complete"]:
            print(f"nothing is missing after {number} rounds: evodrive {'record' if options.record else 'run'} {options.run}")
            return 0
        shards = [Path(path) for path in planned["to_do"]]
        print(f"round {number + 1}: {planned['missing']} records missing, {len(shards)} shards", file=sys.stderr)
        given_up = do_all(shards, Path(planned["folder"]), options)
        merged, code = evodrive(options.evodrive, "shard", "merge", *target)
        if code != 0 or given_up:
            print(f"{given_up} shards given up, {len(merged['refused'])} results refused; see above", file=sys.stderr)
            return code or 1
        if not merged["records"] and not merged["answers"] and not merged["no_label"]:
            print("a round brought nothing; stopped", file=sys.stderr)
            return 1
    print(f"stopped after {options.rounds} rounds; repeat the command to go on", file=sys.stderr)
    return 0
