#!/usr/bin/env python3
"""A second opinion on who touches whom: CommonRoad's drivability checker on exported rollouts.

    python3 -m venv venv && venv/bin/pip install commonroad-drivability-checker==2025.4.0
    evodrive data runs/RUN --out tables
    evodrive scenes export runs/RUN --attempt cat/parent --format scenarionet --out played
    venv/bin/python bridges/commonroad/check_contacts.py tables played

The run's plant must judge boxes as recorded (`simulator.plant = "physical"`): these are the boxes that are exported. Rows are 0.1 s
apart, contact is judged every 0.02 s; between two rows the checker is asked at the same moments, of motion that is interpolated here.
Says how many rollouts agree about contact, partner and time, and lists the others. Exit code 1 where there is one.
"""

import csv
import json
import math
import pathlib
import sys

from commonroad_dc.pycrcc import RectOBB

STEP_S = 0.02
# Motion between rows is no straight line: an edge that is nearer than this may fall on either side.
SLACK_M = 0.02


def labels(tables):
    """Contact of every labelled rollout by solution and scene: its time, None without one."""
    with open(tables / "rollouts.csv", newline="") as file:
        outcomes = {row["record"]: row for row in csv.DictReader(file)}
    found = {}
    with open(tables / "labels.csv", newline="") as file:
        for row in csv.DictReader(file):
            time = outcomes[row["record"]]["contact_s"]
            found[row["scene"], row["solution"]] = float(time) if time else None
    return found


def box(track, row, share, more=0.0):
    """A road user between two rows; None where it is not there in both."""
    state = track["state"]
    if not state["valid"][row] or not state["valid"][min(row + 1, len(state["valid"]) - 1)]:
        return None
    after = min(row + 1, len(state["valid"]) - 1)
    x, y = (
        (1 - share) * state["position"][row][axis] + share * state["position"][after][axis] for axis in (0, 1)
    )
    turn = (state["heading"][after] - state["heading"][row] + math.pi) % (2 * math.pi) - math.pi
    half = [0.5 * state[size][row] + more for size in ("length", "width")]
    return RectOBB(half[0], half[1], state["heading"][row] + share * turn, x, y)


def touched(tracks, ego, row, share, more):
    """Who overlaps the ego then, with boxes that are so much larger on every side."""
    own = box(tracks[ego], row, share, more)
    others = ((name, box(track, row, share, more)) for name, track in tracks.items() if name != ego)
    return {name for name, other in others if own is not None and other is not None and own.collide(other)}


def judged(scene):
    """The first moment at which the ego surely overlaps somebody, and the first at which it may, s; None where there is none."""
    meta, tracks = scene["metadata"], scene["tracks"]
    ego, first, times = meta["sdc_id"], meta["current_time_index"], meta["ts"]
    moments = []
    for row in range(first, len(times) - 1):
        length = times[row + 1] - times[row]
        moments += [(row, k * STEP_S / length, times[row] + k * STEP_S) for k in range(round(length / STEP_S))]
    moments.append((len(times) - 1, 0.0, times[-1]))
    surely = maybe = None
    for row, share, time in moments:
        if maybe is None and touched(tracks, ego, row, share, SLACK_M):
            maybe = time - times[first]
        if maybe is not None and touched(tracks, ego, row, share, -SLACK_M):
            surely = time - times[first]
            break
    return surely, maybe


def agrees(said, surely, maybe):
    """Whether a contact, or that there is none, fits what the checker says, one step of time left or right."""
    if said is None:
        return surely is None
    begun = maybe is not None and maybe <= said + 1.5 * STEP_S
    return begun and (surely is None or surely >= said - 1.5 * STEP_S)


def main():
    if len(sys.argv) < 3:
        sys.exit("expected the folder of `evodrive data` and folders of `evodrive scenes export --format scenarionet`")
    tables, folders = pathlib.Path(sys.argv[1]), [pathlib.Path(folder) for folder in sys.argv[2:]]
    for missing in [path for path in (tables / "rollouts.csv", tables / "labels.csv", *folders) if not path.exists()]:
        sys.exit(f"{missing} is not there; expected the tables of `evodrive data` and then exported folders")
    known = labels(tables)
    rollouts, contacts, wrong = 0, 0, []
    for folder in folders:
        for path in sorted(folder.glob("*.json")):
            scene = json.loads(path.read_text())
            name, _, solution = scene["metadata"]["scenario_id"].rpartition(" ")
            if (name, solution) not in known:
                continue
            said = known[name, solution]
            surely, maybe = judged(scene)
            rollouts += 1
            contacts += said is not None
            if not agrees(said, surely, maybe):
                wrong.append(f"{name} {solution}: contact at {said} s; overlap surely from {surely} s, perhaps from {maybe} s")
    if rollouts == 0:
        sys.exit("found no exported rollout that the tables have a label of; export the attempts of the run that the tables are of")
    print(f"{rollouts - len(wrong)} of {rollouts} rollouts agree, {contacts} of them with a contact")
    print("\n".join(wrong))
    sys.exit(1 if wrong else 0)


main()
