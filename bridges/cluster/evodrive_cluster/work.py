"""One shard on whatever machine it came to."""

import ctypes
import os
import resource
import signal
import socket
import subprocess
import time
from pathlib import Path

from .place import write_whole

# evodrive's exit code where a machine lacks what a shard needs.
LACKING = 69
LOCKED = "is in use by"


class Lost(Exception):
    """The work was killed, or wrote nothing: another try may do."""


class Busy(Exception):
    """What a killed try left is still at work on this machine."""


class Lacking(Exception):
    """This machine lacks what the shard needs: another one may have it."""


class Refused(Exception):
    """The command refused the shard, and would refuse it again."""


def node():
    """What this machine is called."""
    return os.environ.get("EVODRIVE_NODE") or socket.gethostname()


def die_with_parent():
    """A scheduler that kills its worker must not leave the work behind: it would hold the shard's lock."""
    try:
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    except (OSError, AttributeError):
        pass


def do_shard(name, shard, folder, command, jobs, questions=None):
    """The bytes of the result of a shard, what was said meanwhile, the seconds and CPU seconds that it took, and when it began. `folder` holds
    the study; what a killed try had done stays below it, and the next one on this machine goes on from there."""
    at = Path(folder) / "shards"
    at.mkdir(exist_ok=True)
    path = at / name
    write_whole(path, shard)
    words = [*command, "--jobs", str(jobs), "shard", "work", str(path), "--study", str(folder), "--out", str(at)]
    words += ["--open", str(questions)] if questions else []
    began, began_at, before = time.monotonic(), time.time(), resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        ended = subprocess.run(words, capture_output=True, text=True, check=False, errors="replace", preexec_fn=die_with_parent)
    except OSError as error:
        raise Lacking(f"{name} on {node()}: `{words[0]}` cannot be started: {error}") from None
    said = ended.stderr.strip()[-4000:]
    head = f"{name} on {node()}: "
    if ended.returncode < 0:
        raise Lost(f"{head}ended by signal {-ended.returncode}: {said}")
    if ended.returncode == LACKING or ended.returncode in (126, 127) or "GLIBC_" in said:
        raise Lacking(f"{head}{said}")
    if ended.returncode != 0:
        raise (Busy if LOCKED in said else Refused)(f"{head}exit code {ended.returncode}: {said}")
    result = path.with_suffix(".result")
    if not result.is_file():
        raise Lost(f"{head}no result was written: {said}")
    content = result.read_bytes()
    result.unlink()
    path.unlink(missing_ok=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return content, said, (time.monotonic() - began, cpu_s, began_at)
