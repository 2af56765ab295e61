"""Where results lie: a folder, or whatever address fsspec knows (s3://bucket/folder, gs://bucket/folder, memory://folder)."""

import os
import secrets
from pathlib import Path


class Folder:
    """A folder that all machines see."""

    def __init__(self, path):
        self.path = Path(path)
        self.path.mkdir(parents=True, exist_ok=True)

    def write(self, name, content):
        write_whole(self.path / name, content)

    def read(self, name):
        return (self.path / name).read_bytes()

    def names(self):
        return {entry.name for entry in self.path.iterdir()}

    def remove(self, name):
        (self.path / name).unlink(missing_ok=True)


class Address:
    """A folder behind fsspec. An object is there whole or not at all: stores of objects promise that."""

    def __init__(self, address):
        try:
            import fsspec
        except ImportError as error:
            raise SystemExit(f"{address} needs the package fsspec and the one of its protocol: pip install 'evodrive-cluster[s3]' ({error})")
        # Another machine writes there: what was listed before says nothing.
        self.files, self.path = fsspec.core.url_to_fs(address, use_listings_cache=False)
        self.path = self.path.rstrip("/")
        self.files.makedirs(self.path, exist_ok=True)

    def write(self, name, content):
        self.files.pipe_file(f"{self.path}/{name}", content)

    def read(self, name):
        return self.files.cat_file(f"{self.path}/{name}")

    def names(self):
        try:
            return {path.rstrip("/").rsplit("/", 1)[-1] for path in self.files.ls(self.path, detail=False)}
        except FileNotFoundError:
            return set()

    def remove(self, name):
        if name in self.names():
            self.files.rm_file(f"{self.path}/{name}")


def place(address):
    """The place at an address."""
    return Address(address) if "://" in str(address) else Folder(address)


def beside(path, content):
    """A file of another name in the same folder, which nobody else has, whatever machine they are on."""
    part = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(6)}.part")
    with part.open("xb") as file:
        file.write(content)
    return part


def write_whole(path, content):
    """A file is there whole or not at all."""
    beside(path, content).replace(path)


def write_new(path, content):
    """The same where nothing has the name; whether it was free. Of two that write at once one does."""
    part = beside(path, content)
    try:
        os.link(part, path)
    except FileExistsError:
        return False
    finally:
        part.unlink()
    return True
