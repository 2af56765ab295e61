"""A model of the schedule: how long a study takes with so many workers, from the times that another run of it took. `check` holds it to a
run that was measured, `model` goes beyond what was.

A round is a plan, its shards by a greedy list schedule in the measured order, what passes before the first and behind the last of them,
and a merge; rounds follow each other. A shard costs what it took there, and behind another one the gap in which the scheduler sends it. Where models answer, an epoch waits for its questions: those of one slot follow each other,
slots and lineages ask side by side, as many as may be open together."""

import argparse
import heapq
import json
import math
import sys
from pathlib import Path


def makespan(costs, workers):
    """The time until the last of these shards is done, each begun in turn by whoever is free first."""
    free = [0.0] * max(1, min(workers, len(costs)))
    heapq.heapify(free)
    for cost in costs:
        heapq.heappush(free, heapq.heappop(free) + cost)
    return max(free)


def predicted(times, workers):
    """Seconds that a study takes whose rounds were measured."""
    return times["finish_s"] + sum(of["plan_s"] + of["merge_s"] + round_s(times, [shard["work_s"] for shard in of["shards"]], workers)
                                   for of in times["rounds"])


def round_s(times, costs, workers):
    """Seconds from a plan to its merge. Who begins first waits for no other one's end."""
    return times["around_s"] + makespan([cost + times["gap_s"] for cost in costs], workers) - times["gap_s"] if costs else 0.0


def waits(rounds):
    """Of rounds on one worker what is not work: around the shards of a round, and between two of them. Only times of one clock are taken from
    each other: the drivers' or the machine's."""
    around, between, gaps = [], 0.0, 0
    for of in rounds:
        if shards := of["shards"]:
            span = max(shard["began"] + shard["work_s"] for shard in shards) - min(shard["began"] for shard in shards)
            around.append(of["work_wall_s"] - span)
            between += span - sum(shard["work_s"] for shard in shards)
            gaps += len(shards) - 1
    return max(0.0, sum(around) / len(around)) if around else 0.0, max(0.0, between / gaps) if gaps else 0.0


def read(path, cpu=False):
    """The times of a run, by the clock, or of CPU alone where the machine had other work: beginning a shard is not in these."""
    times = json.loads(Path(path).read_text())
    times["finish_s"] = times["finish_s"][cpu]
    for of in times["rounds"]:
        of["plan_s"], of["merge_s"] = of["plan_s"][cpu], of["merge_s"][cpu]
        for shard in of["shards"]:
            shard["work_s"] = shard["work_s"][cpu]
    # Of several workers nobody knows who waited for the scheduler and who for work.
    times["around_s"], times["gap_s"] = (0.0, 0.0) if cpu or times["workers"] != 1 else waits(times["rounds"])
    return times


def check(options):
    """Predicts one run from another one."""
    of, measured = read(options.of), read(options.measured)
    expected, took = predicted(of, measured["workers"]), measured["wall_s"]
    off = expected / took - 1
    print(f"{measured['workers']} workers: predicted {expected:.1f} s from {of['workers']}, measured {took:.1f} s: {off:+.1%}; "
          f"a shard is sent in {of['gap_s']:.2f} s, a round in {of['around_s']:.2f} s, plans {sum(r['plan_s'] for r in of['rounds']):.1f} s, "
          f"merges {sum(r['merge_s'] for r in of['rounds']):.1f} s, the run at the end {of['finish_s']:.1f} s")
    return 0 if abs(off) <= options.within else 1


def spread(costs, count):
    """As many costs as are asked for, in the measured proportions."""
    return [costs[place % len(costs)] for place in range(count)]


def modelled(times, options, workers):
    """Seconds of a study of so many lineages and epochs."""
    lineage_s = {}
    for of in times["rounds"]:
        for shard in of["shards"]:
            lineage = shard["name"].split(" ")[0]
            lineage_s[lineage] = lineage_s.get(lineage, 0.0) + shard["work_s"]
    # What an epoch of a lineage costs, by the lineages that were measured.
    epoch_s = [seconds / times["epochs"] for seconds in lineage_s.values()]
    costs = [options.scale * seconds for seconds in spread(epoch_s, options.lineages)]
    per_lineage = (sum(r["plan_s"] + r["merge_s"] for r in times["rounds"]) + times["finish_s"]) / max(1, len(lineage_s)) / times["epochs"]
    conducting = per_lineage * options.lineages
    asked = questions_s(options)
    if options.by == "lineage":
        # A worker has the CPUs of its shard: slots and scenes of an epoch go side by side.
        threads = max(1, min(options.cpus, workers // options.lineages))
        side_by_side = 1 + options.efficiency * (threads - 1)
        shards = [cost / side_by_side for cost in costs]
        if options.recorded:
            return round_s(times, [options.epochs * cost for cost in shards], workers // threads) + options.epochs * conducting
        one = round_s(times, shards, workers // threads)
        return options.epochs * (one + conducting + asked)
    # Stages of an epoch follow each other: parents' labels, trials, labels of the window, of earlier windows.
    stage = sum(costs) / options.stages
    pieces = max(1, math.ceil(stage / options.shard_s))
    one = round_s(times, [stage / pieces] * pieces, workers)
    return options.epochs * (options.stages * one + conducting * options.stages / 2 + asked)


def questions_s(options):
    """How long the questions of an epoch take."""
    slots = options.lineages * options.slots
    return math.ceil(slots / options.open) * options.questions * options.answer_s


def model(options):
    times = read(options.of, options.cpu)
    of = (lambda workers: predicted(times, workers)) if options.same else (lambda workers: modelled(times, options, workers))
    base = of(1)
    print("workers   seconds   times as fast as one")
    for workers in (int(word) for word in options.workers.split(",")):
        took = of(workers)
        print(f"{workers:7} {took:9.0f} {base / took:10.1f}")
    return 0


def main():
    parser = argparse.ArgumentParser(prog="evodrive-schedule", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    checked = commands.add_parser("check", help="predict a measured run from another one")
    checked.add_argument("of", help="times.json of the run to predict from, with one worker")
    checked.add_argument("measured", help="times.json of the run to predict")
    checked.add_argument("--within", type=float, default=0.1, help="share by which they may differ (default: 0.1)")
    beyond = commands.add_parser("model", help="times of a larger study on more workers")
    beyond.add_argument("of", help="times.json of a measured run")
    beyond.add_argument("--workers", default="1,2,8,64,1000", help="numbers of workers, separated by commas")
    beyond.add_argument("--cpu", action="store_true", help="from seconds of CPU and not of the clock")
    beyond.add_argument("--same", action="store_true", help="the measured study itself, on other numbers of workers")
    beyond.add_argument("--lineages", type=int, default=50)
    beyond.add_argument("--epochs", type=int, default=10)
    beyond.add_argument("--slots", type=int, default=6)
    beyond.add_argument("--by", choices=["lineage", "task"], default="lineage")
    beyond.add_argument("--cpus", type=int, default=1, help="most CPUs of a lineage's shard")
    beyond.add_argument("--efficiency", type=float, default=0.8, help="what a further CPU of a shard brings (default: 0.8)")
    beyond.add_argument("--recorded", action="store_true", help="from a recorded cassette: a lineage is gone to its end at once")
    beyond.add_argument("--scale", type=float, default=1.0, help="work of an epoch beside the measured one")
    beyond.add_argument("--stages", type=int, default=4, help="rounds an epoch takes by task (default: 4)")
    beyond.add_argument("--shard-s", type=float, default=60.0, help="seconds of a shard of tasks (default: 60)")
    beyond.add_argument("--answer-s", type=float, default=0.0, help="seconds until a model answers")
    beyond.add_argument("--questions", type=int, default=3, help="questions of a slot that follow each other (default: 3)")
    beyond.add_argument("--open", type=int, default=256, help="questions that may be open together (default: 256)")
    options = parser.parse_args()
    sys.exit(check(options) if options.command == "check" else model(options))


if __name__ == "__main__":
    main()
