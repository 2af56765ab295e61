"""What a worker needs besides its shards, by content: the binary and the study. A machine unpacks it once."""

import hashlib
import json
import os
import stat
import tempfile
from pathlib import Path

STUDY_FILES = ("experiment.toml", "scenes.pool", "rollouts.jsonl")
PLANNER = "planner"
# Which files came, in the folder itself.
NAMES = ".files"


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


def owned(path, kind):
    """Refuses what somebody else could have put here, or could change: a link, another user's, what others may write to."""
    of = path.lstat()
    if kind(of.st_mode) and of.st_uid == os.getuid() and not of.st_mode & 0o022:
        return
    expected = "a folder" if kind is stat.S_ISDIR else "a file"
    raise PermissionError(f"{path}: expected {expected} of user {os.getuid()} to which nobody else can write, found {stat.filemode(of.st_mode)} of user "
                          f"{of.st_uid}; remove it, or name another folder in EVODRIVE_CACHE")


def kept_in_place(folder):
    """Refuses a folder whose parent lets somebody else put another one in its place."""
    of, trusted = folder.parent.stat(), {0, os.getuid(), os.stat("/").st_uid}
    others = 0o002 if of.st_uid == os.getuid() else 0o022
    if of.st_uid not in trusted or of.st_mode & others and not of.st_mode & stat.S_ISVTX:
        raise PermissionError(f"{folder.parent}: user {of.st_uid} or others could put another folder in the place of {folder.name} "
                              f"({stat.filemode(of.st_mode)}); name another folder in EVODRIVE_CACHE")


def cache():
    """The folder in which this machine keeps what came once: nobody else's, and nobody else can write to it."""
    if named := os.environ.get("EVODRIVE_CACHE"):
        folder = Path(named).resolve()
        folder.parent.mkdir(parents=True, exist_ok=True)
    else:
        folder = Path(tempfile.gettempdir()) / f"evodrive-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700)
    except FileExistsError:
        pass
    owned(folder, stat.S_ISDIR)
    kept_in_place(folder)
    return folder


def unpacked(digest, fetch):
    """The folder with the files of this digest; `fetch` gives them where they are not here yet. What is executed from it is looked at each
    time: whose it is, and that the files are those of the digest."""
    folder = cache() / digest
    if not os.path.lexists(folder):
        files = fetch()
        if digest_of(files) != digest:
            raise ValueError(f"the files that came have the digest {digest_of(files)}, expected {digest}")
        write_whole_folder(folder, {**files, NAMES: json.dumps(sorted(files)).encode()})
    found = digest_of(held(folder))
    if found != digest:
        raise PermissionError(f"{folder}: expected the files that its name says, found files with the digest {found}; remove the folder")
    return folder


def held(folder):
    """The files that came, as they are now. What a planner has written beside them is not looked at."""
    owned(folder, stat.S_ISDIR)

    def content(name):
        path = folder / name
        for above in list(path.relative_to(folder).parents)[:-1]:
            owned(folder / above, stat.S_ISDIR)
        owned(path, stat.S_ISREG)
        return path.read_bytes()

    try:
        return {name: content(name) for name in json.loads(content(NAMES))}
    except FileNotFoundError as lacking:
        raise PermissionError(f"{folder}: expected {lacking.filename}, found none; remove the folder") from None


def write_whole_folder(folder, files):
    """A folder with these files is there whole or not at all, whenever the writer is killed. Nobody else looks into it."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}.") as part:
        whole = Path(part) / "whole"
        for name, content in files.items():
            path = whole / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
            path.chmod(mode(name))
        for path in (whole, *whole.rglob("*")):
            if path.is_dir():
                path.chmod(0o700)
        try:
            whole.rename(folder)
        except OSError:
            # Another process was faster.
            if not folder.is_dir():
                raise
