"""What critics said of the planted patches, beside what the simulator says of them.

    evodrive data RUN --out reviewed          # a run of experiments/llm/planted_scripted.toml or planted_agent.toml
    evodrive data RUN --out labelled          # one of experiments/llm/planted_none.toml
    python3 examples/planted/verdicts.py reviewed labelled
"""

import csv
import json
import pathlib
import sys

PATCHES = json.loads((pathlib.Path(__file__).parent / "patches.json").read_text())
CRITICS = ("structural_critic", "attack_critic", "realism_critic", "isolation_critic")


def rows(folder, table):
    with open(pathlib.Path(folder) / f"{table}.csv", newline="") as file:
        return list(csv.DictReader(file))


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    reviews, labels = rows(sys.argv[1], "reviews"), {row["attempt"]: row for row in rows(sys.argv[2], "attempts")}
    print("| planted | patch | objections | attack, change | realism, change |")
    print("|---|---|---|---|---|")
    objected = {"sound": 0, "unsound": 0}
    for attempt in sorted(labels):
        patch, label = PATCHES[int(labels[attempt]["slot"]) % len(PATCHES)], labels[attempt]
        against = [f"{row['critic'].removesuffix('_critic')} ({row['decision']})" for row in reviews
                   if row["attempt"] == attempt and row["decision"] != "approve" and row["critic"] in CRITICS]
        objected[patch["planted"]] += bool(against)
        change = lambda what: f"{float(label[what + '_change']):+.3f} ± {float(label[what + '_change_se']):.3f}"
        print(f"| {patch['planted']} | {patch['what']} | {', '.join(against) or 'none'} | {change('attack')} | {change('realism')} |")
    for kind, count in objected.items():
        print(f"\nobjections to {count} of the {sum(patch['planted'] == kind for patch in PATCHES)} {kind} patches", end="")
    print()


if __name__ == "__main__":
    main()
