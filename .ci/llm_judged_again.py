"""The programs that SafeBench's recorded searches report, judged again on their held-out routes: any staged contact, as they were evolved; the
preventable count; and that count with the fence for bodies that stand (experiments/safebench/preventable-sac.toml); each against the ego of
the search, which never met traffic, and against ChatScene's.

python3 .ci/llm_judged_again.py BINARY SOURCE=RUN.. prints a table. Simulator and scripts are those of each search.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

HOME = pathlib.Path(__file__).resolve().parent.parent
# Kinds' slides are measured for the preventable count alone.
PREVENTABLE = "[simulator]\nof_kind = true\n[evaluation.safebench.preventable]\nwrong_way_m_max = 10.0\nunrolled_m_max = 0.35\n"
FENCE = "[evaluation.safebench.preventable.standing]\nvisible_s_min = 2.5\nspeed_mps_min = 0.8\n"
COUNTS = {"any staged contact": "", "preventable": PREVENTABLE, "preventable, standing bodies fenced": PREVENTABLE + FENCE}
EGOS = {"sac-safebench": HOME / "policies/sac-safebench.safetensors", "sac-chatscene": "evodrive:sac-chatscene"}


def main():
    binary, *sources = sys.argv[1:]

    def evodrive(*words):
        ran = subprocess.run([binary, *map(str, words)], capture_output=True, text=True)
        if ran.returncode:
            sys.exit(f"evodrive {' '.join(map(str, words))}: {ran.stderr}")
        return ran.stdout

    print("**SafeBench: programs of recorded language models under each count, held-out routes**\n")
    print("| Method | Ego | Count | Parent Attack | Parent CR | Parent ARS | Chosen Attack | Chosen CR | Chosen ARS | Change Attack |")
    print("| --- | --- | --- | --: | --: | --: | --: | --: | --: | --: |")
    with tempfile.TemporaryDirectory() as scratch:
        scratch = pathlib.Path(scratch)
        for source in sources:
            name, run = source.split("=", 1)
            run, study = pathlib.Path(run), HOME / f"experiments/llm/safebench/{name}.toml"
            lineage, = json.loads((run / "result.json").read_text())["result"]["lineages"]
            program, held_out, rules = scratch / f"{name}.json", scratch / f"{name}.pool", scratch / f"{name}.toml"
            evodrive("program", "export", run, lineage["evolved"]["solution"], "--out", program)
            seed = json.loads(program.read_text())["conditions"]["seed"]
            evodrive("scenes", "split", run / "scenes.pool", "--held-out", lineage["held_out_scenes"], "--seed", seed,
                     "--out", scratch / f"{name}-evolution.pool", "--held-out-to", held_out)
            for ego, weights in EGOS.items():
                for count, keys in COUNTS.items():
                    rules.write_text(f"base = {json.dumps(str(study))}\nname = \"judged-again\"\n{keys}")
                    applied = json.loads(evodrive("--json", "apply", program, "--scenes", held_out, "--ego", weights, "--rules", rules))
                    _, parent, chosen, change = applied["tables"][0]["rows"]
                    cells = [row["values"][key]["ours"] for row in (parent, chosen) for key in ("attack", "cr", "ars")]
                    cells.append(change["values"]["attack"]["ours"])
                    print(f"| {name} | {ego} | {count} | {' | '.join(map(cell, cells))} |")
    print("\n- 95 % intervals over groups of family and route; one search a source. Each program was evolved for any staged contact against sac-safebench.")


def cell(of):
    interval = of["interval"]
    return f"{of['value']:.3f}" + (f" [{interval[0]:.3f}, {interval[1]:.3f}]" if interval else "")


main()
