"""What a worker needs besides its shards, by content: the binary and the study. A machine unpacks it once."""

import hashlib
import os
import tempfile
from pathlib import Path

STUDY_FILES = ("experiment.toml", "scenes.pool", "rollouts.jsonl")
PLANNER = "planner"


def study_files(run):
    """The files of a run folder that a worker needs, by name."""
    files = {name: (run / name).read_bytes() for name in STUDY_FILES if (run / name).is_file()}
    planner = run / PLANNER
    for path in sorted(planner.rglob("*")) if planner.is_dir() else ():
        if path.is_file() and "__pycache__" not in path.parts:
            files[str(path.relative_to(run))] = path.read_bytes()
    return files


def mode(name):
    """What may be done with a file that came. A program may be among what a planner or a model needs."""
    return 0o700 if name == "evodrive" or name.startswith(f"{PLANNER}/") else 0o600


def digest_of(files):
    """The name of a set of files: their names and bytes."""
    digest = hashlib.blake2b(digest_size=16)
    for name, content in sorted(files.items()):
        digest.update(f"{name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def cache():
    """The folder in which this machine keeps what came once."""
    named = os.environ.get("EVODRIVE_CACHE")
    folder = Path(named) if named else Path(tempfile.gettempdir()) / f"evodrive-{os.getuid()}"
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        raise PermissionError(f"{folder} belongs to somebody else; name another folder in EVODRIVE_CACHE")
    return folder


def unpacked(digest, fetch):
    """The folder with the files of this digest; `fetch` gives them where they are not here yet."""
    folder = cache() / digest
    if folder.is_dir():
        return folder
    files = fetch()
    if digest_of(files) != digest:
        raise ValueError(f"the files that came have the digest {digest_of(files)}, expected {digest}")
    write_whole_folder(folder, files)
    return folder


def write_whole_folder(folder, files):
    """A folder with these files is there whole or not at all, whenever the writer is killed."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as part:
        whole = Path(part) / "whole"
        for name, content in files.items():
            path = whole / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            path.chmod(mode(name))
        try:
            whole.rename(folder)
        except OSError:
            # Another process was faster.
            if not folder.is_dir():
                raise
