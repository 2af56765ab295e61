"""The programs that MetaDrive's recorded searches by language models report, judged on their held-out scenes by the rules of their own search
and by the paper's (experiments/published.toml): any collision of the ego, plain realism. No question is asked anew.

python3 .ci/llm_under_paper.py BINARY FAMILY=RUN.. prints a table.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

HOME = pathlib.Path(__file__).resolve().parent.parent
RULES = {"own search": None, "the paper's": HOME / "experiments/published.toml"}
FLOOR = 0.95  # The paper's R of an active generator.


def main():
    binary, *sources = sys.argv[1:]

    def evodrive(*words):
        ran = subprocess.run([binary, *map(str, words)], capture_output=True, text=True)
        if ran.returncode:
            sys.exit(f"evodrive {' '.join(map(str, words))}: {ran.stderr}")
        return ran.stdout

    print("**MetaDrive: programs of recorded language models under their own rules and the paper's, held-out scenes**\n")
    print("| Lineage | Rules | Parent Attack | Parent R | Chosen Attack | Chosen R | Change Attack | The paper's selector takes |")
    print("| --- | --- | --: | --: | --: | --: | --: | --- |")
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        for source in sources:
            name, run = source.split("=", 1)
            run = pathlib.Path(run)
            for lineage in json.loads((run / "result.json").read_text())["result"]["lineages"]:
                own = lineage["lineage"]
                program, held_out = scratch / f"{own}.json", scratch / f"{own}.pool"
                evodrive("program", "export", run, lineage["evolved"]["solution"], "--out", program)
                seed = json.loads(program.read_text())["conditions"]["seed"]
                evodrive("scenes", "split", run / "scenes.pool", "--held-out", lineage["held_out_scenes"], "--seed", seed,
                         "--out", scratch / f"{own}-evolution.pool", "--held-out-to", held_out)
                for said, rules in RULES.items():
                    under = ["--rules", rules] if rules else []
                    applied = json.loads(evodrive("--json", "apply", program, "--scenes", held_out, *under))
                    print(row(own, said, applied["tables"][0]))
    print("\n- 95 % intervals over scenes; one search a lineage. Selector: of parent and program the larger attack with R of at least .95, or the more "
          "realistic one where neither has that.")


def row(own, said, table):
    _, parent, chosen, change = table["rows"]
    value = lambda of, key: of["values"][key]["ours"]
    realism = next(key for key in ("realism", "strict_realism", "plain_realism") if key in parent["values"])
    cells = [value(of, key) for of in (parent, chosen) for key in ("attack", realism)] + [value(change, "attack")]
    (a, r), (b, s) = [(value(of, "attack")["value"], value(of, realism)["value"]) for of in (parent, chosen)]
    if r >= FLOOR and s >= FLOOR:
        takes = "parent" if a >= b else "program"
    elif r < FLOOR and s < FLOOR:
        takes = "parent" if r >= s else "program"
    else:
        takes = "parent" if r >= FLOOR else "program"
    return f"| {own} | {said} | {' | '.join(map(cell, cells))} | {takes} |"


def cell(of):
    interval = of["interval"]
    return f"{of['value']:.3f}" + (f" [{interval[0]:.3f}, {interval[1]:.3f}]" if interval else "")


main()
