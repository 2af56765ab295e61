"""evodrive-slurm before the stand-in for Slurm (tests/standin), with a script in place of evodrive. pytest."""

import os
import signal
import sys
from argparse import Namespace
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from evodrive_cluster.command import Evodrive, Failed  # noqa: E402
from evodrive_cluster.conduct import Driver, Shard, Stopped  # noqa: E402
from evodrive_cluster.on_slurm import Slurm  # noqa: E402

# Notes how many are at work while it is: long enough to see whoever is sent meanwhile.
WORK = """#!/bin/bash
shard=$5 at=${0%/*}/under-way
mkdir -p "$at" && mkdir "$at/$$"
for _ in $(seq 15); do
  ls "$at" | wc -l >> "${0%/*}/counts"
  sleep 0.1
done
rmdir "$at/$$"
# The first try of every other shard is lost.
[ $((0x$(basename "$shard" .shard) % 2)) -eq 0 ] || [ -e "$shard.tried" ] || { : > "$shard.tried"; exit 137; }
: > "${shard%.shard}.result"
"""


@pytest.fixture
def cluster(tmp_path, monkeypatch):
    """A folder on a stand-in of three nodes."""
    monkeypatch.setenv("PATH", f"{HERE / 'standin'}:{os.environ['PATH']}")
    monkeypatch.setenv("STANDIN_FOLDER", str(tmp_path / "slurm"))
    monkeypatch.setenv("STANDIN_NODES", "one two three")
    monkeypatch.delenv("EVODRIVE_NODE", raising=False)
    (tmp_path / "shards/logs").mkdir(parents=True)
    return tmp_path


def crew(cluster, script, workers):
    """evodrive-slurm's crew, whose workers call a script."""
    command = cluster / "evodrive"
    command.write_text(script)
    command.chmod(0o700)
    return slurm(cluster, {"experiment.toml": b""}, workers=workers, installed=str(command))


def slurm(cluster, files, workers=None, installed=None):
    """evodrive-slurm's crew, with what travels."""
    options = Namespace(workers=workers, cpus=1, array_max=1000, patience=5.0, sbatch=[], installed=installed, open=None)
    return Slurm(options, files, cluster / "shards")


def shards(cluster, count):
    for number in range(count):
        (cluster / f"shards/{number:02x}.shard").write_text("")
    return [Shard(path, f"lineage-{path.stem} epoch 1") for path in sorted((cluster / "shards").glob("*.shard"))]


@pytest.mark.parametrize("workers", [1, 2])
def test_no_more_shards_are_under_way_than_workers(cluster, workers):
    # Also where lost ones are sent again beside the others, in an array of their own.
    of = crew(cluster, WORK, workers)
    under_way, kinds = 0, []
    for shard in shards(cluster, 4):
        of.submit(shard, 1, set())
        under_way += 1
    while under_way:
        for event in of.wait():
            kinds.append(event.kind)
            if event.kind == "lost":
                of.submit(event.shard, 2, set())
            else:
                under_way -= 1
    assert sorted(kinds) == ["done"] * 4 + ["lost"] * 2
    counts = [int(line) for line in (cluster / "counts").read_text().split()]
    assert len(counts) == 6 * 15 and max(counts) == workers, counts


# Needs a file and Python, as `evodrive shard work` with a planner does: exit code 69 names what is not there.
NEEDING = """#!/bin/bash
shard=$5
for need in planner.py python3; do
  [ -e "${0%/*}/$SLURMD_NODENAME/$need" ] || { echo "this machine lacks $need, which the shard needs" >&2; exit 69; }
done
echo "$SLURMD_NODENAME" > "${shard%.shard}.result"
"""


class Driven(Driver):
    """The driver's own round with this crew, without a plan and a merge."""

    def __init__(self, crew, shards):
        super().__init__(Namespace(evodrive="evodrive", by="lineage", retries=1), None)
        self.crew, self.shards, self.results = crew, shards, None
        self.times = {"rounds": [{"shards": []}]}


@pytest.mark.parametrize("missing", ["planner.py", "python3"])
def test_a_shard_goes_from_a_node_that_lacks_something_to_one_that_has_it(cluster, missing):
    for node in ("one", "two", "three"):
        (cluster / node).mkdir()
        for need in {"planner.py", "python3"} - ({missing} if node != "three" else set()):
            (cluster / node / need).write_text("")
    to_do = shards(cluster, 3)
    driven = Driven(crew(cluster, NEEDING, None), cluster / "shards")
    driven.round(1, to_do)
    assert [shard.result.read_text() for shard in to_do] == ["three\n"] * 3
    said = [path.read_text() for path in (cluster / "shards/logs").glob("*-1.log")]
    assert any(f"this machine lacks {missing}, which the shard needs" in text for text in said)


def test_what_no_node_has_is_named(cluster):
    to_do = shards(cluster, 2)
    with pytest.raises(Stopped) as stopped:
        Driven(crew(cluster, NEEDING, None), cluster / "shards").round(1, to_do)
    assert "this machine lacks planner.py, which the shard needs" in str(stopped.value)
    assert "there is no other machine" in str(stopped.value)


def test_a_program_that_is_not_there_is_named_with_what_helps(tmp_path):
    with pytest.raises(Failed) as failed:
        Evodrive([str(tmp_path / "evodrive")]).json("shard", "plan", "study.toml")
    assert str(tmp_path / "evodrive") in failed.value.said and "cargo build --release" in failed.value.said


@pytest.mark.parametrize("done", [0, 1, 2, 3])
def test_a_driver_killed_while_it_writes_the_bundle_leaves_none_that_is_half(cluster, monkeypatch, done):
    files = {"evodrive": b"\x7fELF" * 1000, "experiment.toml": b"name", "planner/main.py": b"print()"}
    if child := os.fork():
        _, status = os.waitpid(child, 0)
        assert os.waitstatus_to_exitcode(status) == -signal.SIGKILL
    else:
        # Killed within the write of the last file that is begun: half of it is there, and nobody may run it yet.
        write, begun = Path.write_bytes, []

        def killed(path, content):
            begun.append(path)
            if len(begun) > done:
                write(path, content[:len(content) // 2])
                os.kill(os.getpid(), signal.SIGKILL)
            write(path, content)
            if len(begun) == len(files):
                os.kill(os.getpid(), signal.SIGKILL)

        monkeypatch.setattr(Path, "write_bytes", killed)
        try:
            slurm(cluster, files)
        finally:
            os._exit(1)
    bundle = slurm(cluster, files).bundle
    assert {str(path.relative_to(bundle)): path.read_bytes() for path in bundle.rglob("*") if path.is_file()} == files
    assert os.access(bundle / "evodrive", os.X_OK) and os.access(bundle / "planner/main.py", os.X_OK)
