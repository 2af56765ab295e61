"""The programs that SafeBench's recorded searches report, judged again on their held-out routes: any staged contact, as they were evolved; the
preventable count; and that count with the fence for bodies that stand (experiments/safebench/preventable-sac.toml); each against the ego of
the search, which never met traffic, and against ChatScene's.

python3 .ci/llm_judged_again.py BINARY SOURCE=RUN.. prints a table. Simulator and scripts are those of each search.
"""
import json
import pathlib
import sys
import tempfile

from recorded_programs import Evodrive, cell, ours

HOME = pathlib.Path(__file__).resolve().parent.parent
# Kinds' slides are measured for the preventable count alone.
PREVENTABLE = "[simulator]\nof_kind = true\n[evaluation.safebench.preventable]\nwrong_way_m_max = 10.0\nunrolled_m_max = 0.35\n"
FENCE = "[evaluation.safebench.preventable.standing]\nvisible_s_min = 2.5\nspeed_mps_min = 0.8\n"
COUNTS = {"any staged contact": "", "preventable": PREVENTABLE, "preventable, standing bodies fenced": PREVENTABLE + FENCE}
EGOS = {"sac-safebench": HOME / "policies/sac-safebench.safetensors", "sac-chatscene": "evodrive:sac-chatscene"}


def main():
    binary, *sources = sys.argv[1:]
    evodrive = Evodrive(binary)
    print("**SafeBench: programs of recorded language models under each count, held-out routes**\n")
    print("| Method | Ego | Count | Parent Attack | Parent CR | Parent ARS | Chosen Attack | Chosen CR | Chosen ARS | Change Attack |")
    print("| --- | --- | --- | --: | --: | --: | --: | --: | --: | --: |")
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        for source in sources:
            name, run = source.split("=", 1)
            study, rules = HOME / f"experiments/llm/safebench/{name}.toml", scratch / f"{name}.toml"
            (_, program, held_out), = evodrive.programs(run, scratch)
            for ego, weights in EGOS.items():
                for count, keys in COUNTS.items():
                    rules.write_text(f"base = {json.dumps(str(study))}\nname = \"judged-again\"\n{keys}")
                    _, parent, chosen, change = evodrive.applied(program, held_out, "--ego", weights, "--rules", rules)
                    cells = [ours(row, key) for row in (parent, chosen) for key in ("attack", "cr", "ars")] + [ours(change, "attack")]
                    print(f"| {name} | {ego} | {count} | {' | '.join(map(cell, cells))} |")
    print("\n- 95 % intervals over groups of family and route; one search a source. Each program was evolved for any staged contact against sac-safebench.")


main()
