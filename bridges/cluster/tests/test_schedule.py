"""The model of the schedule, held to a schedule that is played out here. pytest."""

import json
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from evodrive_cluster.schedule import makespan, predicted, read  # noqa: E402

WORK = [[4.0, 3.0, 5.0, 2.0, 6.0], [9.0, 1.0, 1.0, 1.0]]
PLAN, MERGE, FINISH, BEFORE, GAP, BEHIND = 2.0, 0.5, 3.0, 0.7, 0.4, 0.3


def played(workers, skew=0.0):
    """The times of a run whose scheduler takes a while before it sends a shard; its machines' clocks are not the driver's."""
    now, rounds = 100.0, []
    for work in WORK:
        now += PLAN
        begun, shards = now, []
        free = [now + BEFORE] * workers
        for number, seconds in enumerate(work):
            worker = free.index(min(free))
            at = free[worker] + (GAP if number >= workers else 0.0)
            shards.append({"name": f"lineage-{number} epoch 1", "work_s": [seconds, seconds / 2], "began": at + skew, "node": str(worker)})
            free[worker] = at + seconds
        now = max(free) + BEHIND
        rounds.append({"plan_s": [PLAN, 1.0], "work_wall_s": now - begun, "merge_s": [MERGE, 0.1], "shards": shards})
        now += MERGE
    rounds.append({"plan_s": [0.0, 0.0], "work_wall_s": 0.0, "merge_s": [0.0, 0.0], "shards": []})
    return {"rounds": rounds, "workers": workers, "finish_s": [FINISH, 2.0], "wall_s": now + FINISH - 100.0, "epochs": 2}


@pytest.mark.parametrize("workers", [1, 2, 3, 9])
def test_a_run_on_more_workers_is_predicted_from_one(tmp_path, workers):
    path = tmp_path / "times.json"
    path.write_text(json.dumps(played(1, skew=-3600.0)))
    times = read(path)
    assert (times["around_s"], times["gap_s"]) == (pytest.approx(BEFORE + BEHIND), pytest.approx(GAP))
    assert predicted(times, workers) == pytest.approx(played(workers)["wall_s"])


def test_seconds_of_cpu_know_no_waiting(tmp_path):
    path = tmp_path / "times.json"
    path.write_text(json.dumps(played(1)))
    times = read(path, cpu=True)
    assert predicted(times, 1) == pytest.approx(2.0 + 2 * 1.0 + 2 * 0.1 + sum(sum(work) for work in WORK) / 2)


def test_shards_go_to_whoever_is_free_first():
    assert makespan([3, 1, 1, 1], 2) == 3
    assert makespan([1, 1, 1, 3], 2) == 4
    assert makespan([2.0], 1000) == 2.0
