#!/usr/bin/env python3
"""Kills what a study on a cluster rests on, at drawn times, until so many kills were made, and compares every root with the plain run's.

    check_kills.py --evodrive target/debug/evodrive --on ray --kills 30 --seed 1

On Ray a head without CPUs and two nodes are started here; drawn are a worker process of Ray, evodrive itself in a task, the driver, a node as
a whole, and a node's raylet alone, which holds its object store: a new node takes its place. On Slurm (`--on slurm`, or `standin` where Slurm is not installed: the commands of
tests/standin) drawn are evodrive in a task, the task (scancel), the driver. The last study meets a result that came twice, a corrupt one
and one that lies. It needs no quiet machine."""

import argparse
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from evodrive_cluster.work import die_with_parent  # noqa: E402

STUDY = """base = "{base}"
name = "killed"
cassette = "killed.jsonl"
[scenes]
source = "synth"
count = {scenes}
seed = 7
[split]
evolution = {{ count = {evolution} }}
held_out = {held_out}
window = 8
[budget]
epochs = {epochs}
slots = 4
max_repair_rounds = 1
probe_scenes = 4
finalists = 2
"""


def processes(is_wanted):
    """Processes that are wanted, by their command lines and parents."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes().decode(errors="replace").split("\0")
                parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
                if is_wanted(words, parent):
                    yield int(entry.name)
            except OSError:
                pass


def kill(pids, rng):
    pids = sorted(pids)
    if not pids:
        return False
    try:
        os.kill(rng.choice(pids), signal.SIGKILL)
        return True
    except ProcessLookupError:
        return False


class Cluster:
    """Nodes of Ray on this machine."""

    TARGETS = ["task", "worker", "driver", "node", "store"]

    def __init__(self, _scratch):
        from ray.cluster_utils import Cluster as Nodes
        self.nodes = Nodes(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
        self.workers = [self.nodes.add_node(num_cpus=1) for _ in range(2)]
        self.environment = dict(os.environ)

    def command(self):
        return [sys.executable, "-m", "evodrive_cluster.on_ray"], ["--address", self.nodes.address]

    def kill(self, target, rng):
        if target == "worker":
            own = {pid for node in self.workers for pid in self.raylets(node)}
            return kill(processes(lambda words, parent: parent in own and words[0].startswith("ray::") and "IDLE" not in words[0]), rng)
        if target == "store":
            return kill(self.raylets(rng.choice(self.workers)), rng)
        self.replace(rng.randrange(len(self.workers)))
        return True

    @staticmethod
    def raylets(node):
        """The process of a node that holds its object store."""
        return [of.process.pid for of in node.all_processes.get("raylet", [])]

    def replace(self, at):
        """A node is gone with its object store, and another one comes."""
        self.nodes.remove_node(self.workers[at], allow_graceful=False)
        self.workers[at] = self.nodes.add_node(num_cpus=1)

    def mend(self):
        """A node whose agent was killed ends itself: another one comes."""
        for at, node in enumerate(self.workers):
            if any(of.process.poll() is not None for of in node.all_processes.get("raylet", [])):
                self.replace(at)

    def close(self):
        self.nodes.shutdown()


class Queue:
    """Slurm, or its stand-in."""

    TARGETS = ["task", "worker", "driver"]

    def __init__(self, scratch):
        self.environment = dict(os.environ)

    def command(self):
        return [sys.executable, str(HERE / "evodrive-slurm")], ["--patience", "3"]

    def mend(self):
        pass

    def kill(self, _target, rng):
        said = subprocess.run(["squeue", "--noheader", "--array", "--format=%F_%K", "--states=running"], capture_output=True, text=True,
                              env=self.environment, check=False).stdout.split()
        if not said:
            return False
        subprocess.run(["scancel", rng.choice(said)], env=self.environment, check=False)
        return True

    def close(self):
        pass


class StandIn(Queue):
    def __init__(self, scratch):
        super().__init__(scratch)
        self.environment["STANDIN_FOLDER"] = str(scratch / "standin")
        self.environment["PATH"] = f"{HERE / 'tests/standin'}:{self.environment['PATH']}"


def served(scratch, protocol):
    """A server of the protocol of S3, or of Google's, on this machine: the environment that leads to it."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    beside = Path(sys.executable).with_name
    words = {"s3": [beside("moto_server"), "-H", "127.0.0.1", "-p", port],
             "gs": [beside("gcp-storage-emulator"), "start", "-H", "127.0.0.1", "--port", port, "-M", "--default-bucket", "studies"]}[protocol]
    subprocess.Popen([str(word) for word in words], preexec_fn=die_with_parent, stdout=(scratch / "server.log").open("w"),
                     stderr=subprocess.STDOUT)
    until = time.monotonic() + 60
    while time.monotonic() < until:
        with socket.socket() as there:
            if there.connect_ex(("127.0.0.1", port)) == 0:
                break
        time.sleep(0.2)
    at = f"http://127.0.0.1:{port}"
    # The last one: else gcsfs asks Google itself what kind of bucket it is, and waits.
    return {"s3": {"AWS_ACCESS_KEY_ID": "any", "AWS_SECRET_ACCESS_KEY": "any", "AWS_DEFAULT_REGION": "us-east-1", "AWS_ENDPOINT_URL": at},
            "gs": {"FSSPEC_GS_TOKEN": "anon", "FSSPEC_GS_ENDPOINT_URL": at, "GCSFS_EXPERIMENTAL_ZB_HNS_SUPPORT": "false"}}[protocol]


def evodrive(options, *words):
    ended = subprocess.run([options.evodrive, *words], capture_output=True, text=True, check=False)
    if ended.returncode != 0:
        sys.exit(f"evodrive {' '.join(map(str, words))} ended with {ended.returncode}: {ended.stderr}")
    return ended.stdout


def root_of(text):
    lines = [line for line in text.splitlines() if line.startswith("root: ")]
    return lines[-1] if lines else None


def end_of(log):
    """What the drivers said last: the folder of their log need not outlive this check."""
    said = Path(log.name).read_text(errors="replace").splitlines()
    return "\n".join([log.name, *said[-30:]])


def study_with_kills(options, cluster, experiment, out, left, rng, log):
    """One study on the cluster, whose parts are killed meanwhile: its root, and what was killed."""
    words, more = cluster.command()
    words = [*words, "run", str(experiment), "--out", str(out), "--evodrive", options.evodrive, "--no-report", "--retries", "100",
             "--by", options.by, "--size", "8", *(["--results", f"{options.results}://studies/{out.name}"] if options.results else []), *more]
    environment = {**cluster.environment, "PYTHONPATH": str(HERE)}
    begin = lambda resume: subprocess.Popen([*words, *(["--resume"] if resume else [])], stdout=subprocess.PIPE, stderr=log, text=True,
                                            env=environment, preexec_fn=die_with_parent)
    driver, killed = begin(False), Counter()
    due = time.monotonic() + rng.expovariate(1 / options.every)
    while driver.poll() is None:
        time.sleep(0.05)
        cluster.mend()
        if sum(killed.values()) >= left or time.monotonic() < due:
            continue
        target = rng.choice(cluster.TARGETS)
        if target == "driver":
            driver.kill()
            driver.wait()
            driver, made = begin(True), True
        elif target == "task":
            # Of this check alone: what it does lies below its folder.
            made = kill(processes(lambda of, _: "shard" in of and "work" in of and any(word.startswith(str(out.parent)) for word in of)), rng)
        else:
            made = cluster.kill(target, rng)
        if made:
            killed[target] += 1
            print(f"killed: {target}", file=log, flush=True)
            due = time.monotonic() + rng.expovariate(1 / options.every)
    said = driver.stdout.read()
    if driver.returncode != 0:
        sys.exit(f"the driver ended with {driver.returncode} after {dict(killed)}: {end_of(log)}")
    return root_of(said), killed


def harmed(options, cluster, experiment, out, log):
    """A study into which a result comes twice, a corrupt one and a made up one: its root."""
    evodrive(options, "shard", "plan", str(experiment), "--out", str(out), "--size", "8")
    run = next(path for path in out.iterdir() if path.is_dir())
    shards = sorted((run / "shards").glob("*.shard"))
    evodrive(options, "--jobs", "2", "shard", "work", *map(str, shards))
    results = [shard.with_suffix(".result") for shard in shards]
    corrupt = bytearray(results[1].read_bytes())
    corrupt[len(corrupt) // 2] ^= 1
    results[1].write_bytes(corrupt)
    liar = next(result for result in results[2:] if b'"outcome"' in result.read_bytes())
    subprocess.run([sys.executable, str(HERE / "tests/lie.py"), str(liar)], check=True)
    words, more = cluster.command()
    ended = subprocess.run([*words, "run", str(experiment), "--out", str(out), "--evodrive", options.evodrive, "--no-report", "--by", "task",
                            "--size", "8", "--audit", "1", *more], stdout=subprocess.PIPE, stderr=log, text=True, check=False,
                           env={**cluster.environment, "PYTHONPATH": str(HERE)})
    if ended.returncode != 0:
        sys.exit(f"the driver of the harmed study ended with {ended.returncode}: {end_of(log)}")
    refused = len(list((run / "shards/refused").iterdir()))
    # The first one comes once more.
    twice = out.parent / "twice"
    twice.mkdir(exist_ok=True)
    shutil.copy(run / "shards/merged" / results[0].name, twice)
    evodrive(options, "shard", "merge", str(experiment), "--out", str(out), "--results", str(twice))
    again = root_of(evodrive(options, "run", str(experiment), "--out", str(out), "--no-report"))
    return (root_of(ended.stdout) if again == root_of(ended.stdout) else again), refused


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--evodrive", required=True)
    parser.add_argument("--on", choices=["ray", "slurm", "standin"], required=True)
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--every", type=float, default=4.0, help="mean seconds between two kills (default: 4)")
    parser.add_argument("--by", choices=["lineage", "task"], default="lineage")
    parser.add_argument("--epochs", type=int, default=4)
    parser.add_argument("--scenes", type=int, default=40)
    parser.add_argument("--results", choices=["s3", "gs"], help="Ray: results through a local server of this protocol (moto, or "
                        "gcp-storage-emulator)")
    parser.add_argument("--harm", action="store_true", help="also the study with a result that comes twice, a corrupt and a lying one")
    parser.add_argument("--folder", help="where everything is written, and stays (default: a folder that is removed)")
    options = parser.parse_args()
    options.evodrive = str(Path(options.evodrive).resolve())
    own = None if options.folder else tempfile.TemporaryDirectory(prefix="evodrive-kills-")
    scratch = Path(options.folder or own.name).resolve()
    scratch.mkdir(parents=True, exist_ok=True)
    experiment = scratch / "killed.toml"
    evolution = options.scenes // 2
    experiment.write_text(STUDY.format(base=HERE.parents[1] / "experiments/quickstart.toml", scenes=options.scenes, evolution=evolution,
                                       held_out=evolution // 2, epochs=options.epochs))
    plain = root_of(evodrive(options, "record", str(experiment), "--out", str(scratch / "plain"), "--no-report"))
    if options.results:
        os.environ |= served(scratch, options.results)
    # Also for the nodes of Ray that are started here: by this folder the work of a task is known.
    os.environ["EVODRIVE_CACHE"] = str(scratch / "cache")
    cluster = {"ray": Cluster, "slurm": Queue, "standin": StandIn}[options.on](scratch)
    rng, killed, studies, began = random.Random(options.seed), Counter(), 0, time.monotonic()
    try:
        with (scratch / "driver.log").open("w") as log:
            while sum(killed.values()) < options.kills:
                studies += 1
                root, of = study_with_kills(options, cluster, experiment, scratch / f"runs-{studies}", options.kills - sum(killed.values()),
                                            rng, log)
                killed += of
                if root != plain:
                    sys.exit(f"study {studies} ended in {root}, the plain run in {plain}: {end_of(log)}")
                if not of and studies > 50:
                    sys.exit("fifty studies ended before anything was killed: lower --every")
            refused = 0
            if options.harm:
                root, refused = harmed(options, cluster, experiment, scratch / "harmed", log)
                if root != plain or refused < 2:
                    sys.exit(f"the harmed study ended in {root} with {refused} results refused, the plain run in {plain}")
    finally:
        cluster.close()
    kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(killed.items()))
    print(f"{options.on}: {studies} studies, {sum(killed.values())} kills ({kinds}), {refused} results refused, "
          f"{time.monotonic() - began:.0f} s; every {plain}")


main()
