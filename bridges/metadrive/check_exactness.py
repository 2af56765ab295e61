"""Plays requests twice in one worker, in reverse, and in a new worker; the answers must be the same bytes.

The file holds request lines as a worker reads them: `evodrive record` shows them to a command such as `tee`.
"""

import subprocess
import sys
from pathlib import Path


def answers(lines: list[str]) -> list[str]:
    """What a new worker says to these lines."""
    command = [sys.executable, "-m", "evodrive_metadrive.worker"]
    ran = subprocess.run(command, input="\n".join(lines) + "\n", capture_output=True, text=True, check=True)
    return ran.stdout.splitlines()[1:]


def main() -> int:
    """0 if every answer is the same bytes every time."""
    lines = [line for line in Path(sys.argv[1]).read_text().splitlines() if line.strip()]
    first = answers(lines)
    again = answers(lines[::-1] + lines)
    same = again[: len(lines)][::-1] == first and again[len(lines) :] == first
    failed = sum('"failure"' in line for line in first)
    print(f"{len(first)} requests, {failed} failed; three answers each: {'the same bytes' if same else 'DIFFERENT'}")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
