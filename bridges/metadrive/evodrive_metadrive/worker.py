"""The worker: one JSON line in, one JSON line out. Standard output belongs to the protocol alone."""

import hashlib
import json
import os
import sys
import traceback
from importlib import metadata
from pathlib import Path

from . import BACKEND, PROTOCOL, stubs
from .request import EGOS, Refused, read

# What a pose or a contact can depend on besides this package.
DEPENDS_ON = ("metadrive-simulator", "panda3d", "numpy", "scipy", "shapely", "gymnasium")


def digest() -> str:
    """SHA-256 of this package's sources and of the versions that it runs with."""
    sha = hashlib.sha256()
    here = Path(__file__).parent
    for source in sorted(here.glob("*.py")):
        text = source.read_bytes()
        sha.update(f"{source.name} {len(text)}\n".encode() + text)
    for name in DEPENDS_ON:
        sha.update(f"{name} {metadata.version(name)}\n".encode())
    sha.update(f"python {sys.version_info.major}.{sys.version_info.minor}\n".encode())
    return sha.hexdigest()


def say(out, message: dict) -> None:
    """Writes one line; NaN and infinities are refused here rather than sent."""
    out.write(json.dumps(message, separators=(",", ":"), allow_nan=False) + "\n")
    out.flush()


def own_output():
    """The real standard output; everything else that writes there, C code included, goes to standard error from now on."""
    ours = os.fdopen(os.dup(1), "w", encoding="utf-8", newline="\n")
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return ours


def answer(line: str) -> dict:
    """The answer to one request line."""
    message = json.loads(line)
    key = message["request"]
    try:
        request = read(message)
        from .rollout import play

        return {"request": key, **play(request)}
    except Refused as refused:
        return {"request": key, "failure": f"refused: {refused}"}
    except Exception as error:  # The rollout failed, the worker goes on; the trace is for whoever looks.
        traceback.print_exc()
        return {"request": key, "failure": f"{type(error).__name__}: {error}"[:500]}


def hello() -> dict:
    """Who this is, or why it cannot work."""
    said = {"evodrive_worker": PROTOCOL, "backend": BACKEND}
    try:
        version = metadata.version("metadrive-simulator")
        if not stubs.are_there():
            return {**said, "failure": "MetaDrive has no assets and would download them; run `evodrive-metadrive-stubs` once"}
        return {**said, "version": version, "digest": digest(), "egos": list(EGOS)}
    except (metadata.PackageNotFoundError, FileNotFoundError) as error:
        return {**said, "failure": f"{error}; install the bridge with `pip install ./bridges/metadrive`"}


def main() -> int:
    """Serves until standard input ends."""
    if sys.argv[1:] == ["--hello"]:
        print(json.dumps(hello()))
        return 0
    out = own_output()
    greeting = hello()
    say(out, greeting)
    if "failure" in greeting:
        return 1
    for line in sys.stdin:
        if line.strip():
            say(out, answer(line))
    return 0


if __name__ == "__main__":
    sys.exit(main())
