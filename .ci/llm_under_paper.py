"""The programs that MetaDrive's recorded searches by language models report, judged on their held-out scenes by the rules of their own search
and by the paper's (experiments/published.toml): any collision of the ego, plain realism. No question is asked anew.

python3 .ci/llm_under_paper.py BINARY FAMILY=RUN.. prints a table.
"""
import pathlib
import sys
import tempfile

from recorded_programs import Evodrive, cell, ours

HOME = pathlib.Path(__file__).resolve().parent.parent
RULES = {"own search": None, "the paper's": HOME / "experiments/published.toml"}
FLOOR = 0.95  # The paper's R of an active generator.


def main():
    binary, *sources = sys.argv[1:]
    evodrive = Evodrive(binary)
    print("**MetaDrive: programs of recorded language models under their own rules and the paper's, held-out scenes**\n")
    print("| Lineage | Rules | Parent Attack | Parent R | Chosen Attack | Chosen R | Change Attack | The paper's selector takes |")
    print("| --- | --- | --: | --: | --: | --: | --: | --- |")
    with tempfile.TemporaryDirectory() as scratch:
        for source in sources:
            _, run = source.split("=", 1)
            for own, program, held_out in evodrive.programs(run, scratch):
                for said, rules in RULES.items():
                    under = ["--rules", rules] if rules else []
                    print(row(own, said, evodrive.applied(program, held_out, *under)))
    print("\n- 95 % intervals over scenes; one search a lineage. Selector: of parent and program the larger attack with R of at least .95, or the more "
          "realistic one where neither has that.")


def row(own, said, rows):
    _, parent, chosen, change = rows
    realism = next(key for key in ("realism", "strict_realism", "plain_realism") if key in parent["values"])
    cells = [ours(of, key) for of in (parent, chosen) for key in ("attack", realism)] + [ours(change, "attack")]
    (a, r), (b, s) = [(ours(of, "attack")["value"], ours(of, realism)["value"]) for of in (parent, chosen)]
    if r >= FLOOR and s >= FLOOR:
        takes = "parent" if a >= b else "program"
    elif r < FLOOR and s < FLOOR:
        takes = "parent" if r >= s else "program"
    else:
        takes = "parent" if r >= FLOOR else "program"
    return f"| {own} | {said} | {' | '.join(map(cell, cells))} | {takes} |"


main()
