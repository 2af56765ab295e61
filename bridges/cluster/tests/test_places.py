"""Where results lie: a folder, fsspec's memory, and local servers of the S3 protocol and of Google's. pytest, or by itself."""

import socket
import sys
import threading
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from evodrive_cluster.bundle import digest_of, unpacked  # noqa: E402
from evodrive_cluster.place import place  # noqa: E402


def held(at):
    assert at.names() == set()
    at.write("a.result", b"one")
    at.write("b.result", b"\0" * (6 << 20))
    at.write("a.result", b"two")
    assert at.names() == {"a.result", "b.result"}
    assert at.read("a.result") == b"two" and len(at.read("b.result")) == 6 << 20
    at.remove("a.result")
    at.remove("a.result")
    assert at.names() == {"b.result"}


def test_a_folder(tmp_path):
    held(place(tmp_path / "results"))


def test_an_address_of_fsspec():
    pytest.importorskip("fsspec")
    held(place("memory://evodrive/results"))


@pytest.fixture
def s3(monkeypatch):
    """A server of the S3 protocol on this machine."""
    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in {"AWS_ACCESS_KEY_ID": "any", "AWS_SECRET_ACCESS_KEY": "any", "AWS_ENDPOINT_URL": f"http://{host}:{port}",
                        "AWS_DEFAULT_REGION": "us-east-1"}.items():
        monkeypatch.setenv(name, value)
    yield "s3://studies/one"
    server.stop()


def shared(address):
    """Another process sees what was written there since it looked."""
    first, second = place(address), place(address)
    assert "c.result" not in second.names()
    first.write("c.result", b"three")
    assert "c.result" in second.names() and second.read("c.result") == b"three"


def test_an_address_of_s3(s3):
    held(place(s3))
    shared(s3)


@pytest.fixture
def gs(monkeypatch, tmp_path):
    """A server of Google's protocol on this machine."""
    # Else gcsfs asks Google itself what kind of bucket it is, and waits.
    monkeypatch.setenv("GCSFS_EXPERIMENTAL_ZB_HNS_SUPPORT", "false")
    pytest.importorskip("gcsfs")
    emulator = pytest.importorskip("gcp_storage_emulator.server")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = emulator.create_server("127.0.0.1", port, in_memory=True, default_bucket="studies")
    server.start()
    monkeypatch.setitem(pytest.importorskip("fsspec").config.conf, "gs", {"token": "anon", "endpoint_url": f"http://127.0.0.1:{port}"})
    yield "gs://studies/one"
    server.stop()


def test_an_address_of_gs(gs):
    held(place(gs))
    shared(gs)


def test_a_machine_unpacks_what_travels_once(tmp_path, monkeypatch):
    monkeypatch.setenv("EVODRIVE_CACHE", str(tmp_path / "cache"))
    files, fetched = {"evodrive": b"#!/bin/sh\n", "planner/idm.py": b"x"}, []
    fetch = lambda: fetched.append(1) or files
    tasks = [threading.Thread(target=unpacked, args=(digest_of(files), fetch)) for _ in range(8)]
    for task in tasks:
        task.start()
    for task in tasks:
        task.join()
    folder = unpacked(digest_of(files), lambda: pytest.fail("it is there"))
    assert (folder / "planner/idm.py").read_bytes() == b"x" and (folder / "evodrive").stat().st_mode & 0o100
    assert [entry.name for entry in folder.parent.iterdir()] == [digest_of(files)], "nothing half made stays"
    with pytest.raises(ValueError):
        unpacked(digest_of({"evodrive": b"another"}), lambda: files)
