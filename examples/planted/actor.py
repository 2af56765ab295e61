"""An actor that always proposes the same eight patches, one a slot: four sound ones and four with a planted fault that no gate can see.

A model of the kind `command` (docs/MODELS.md): a question as one line of JSON on standard input, the reply on standard output.
"""

import json
import pathlib
import re
import sys

PATCHES = json.loads((pathlib.Path(__file__).parent / "patches.json").read_text())


def main():
    question = json.load(sys.stdin)
    planted = PATCHES[question["slot"]["slot"] % len(PATCHES)]
    form = question["messages"][-1]["text"]
    # The form of the answer, at the end of the task, holds what a patch repeats of its parent.
    repeated = {name: re.findall(rf'"{name}": "([^"]*)"', form)[-1] for name in ("source_baseline", "parent_solution_id", "parent_program_hash", "response_id")}
    response_id = repeated.pop("response_id")
    patch = {**repeated, "hypothesis": planted["hypothesis"], "operations": planted["operations"], "memory_refs_used": [], "cluster_refs_used": []}
    json.dump({"response_id": response_id, "program_patch": patch}, sys.stdout)


if __name__ == "__main__":
    main()
