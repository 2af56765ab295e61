"""What a machine executes from its cache is its user's own and what its name says, on Slurm and on Ray. pytest."""

import json
import os
import subprocess
import sys
import threading
from argparse import Namespace
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from evodrive_cluster.bundle import NAMES, digest_of, unpacked, write_whole_folder  # noqa: E402
from evodrive_cluster.conduct import Driver, Stopped, driver_file  # noqa: E402
from evodrive_cluster.on_slurm import Slurm  # noqa: E402
from evodrive_cluster.place import write_new  # noqa: E402

HONEST = b"#!/bin/sh\necho the honest binary runs\n"
FOREIGN = "#!/bin/sh\necho somebody else's code runs\n"
FILES = {"evodrive": HONEST, "experiment.toml": b"name", "planner/deep/main.py": b"print()"}
DIGEST = digest_of(FILES)
# A user that no test runs as.
OTHER = 4321


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A temporary folder for all users of a machine, and a bundle on a disk that all machines see."""
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp").chmod(0o1777)
    (tmp_path / "logs").mkdir()
    (tmp_path / "list").write_text(f"{tmp_path}/x.shard\tname\n")
    write_whole_folder(tmp_path / "travel" / DIGEST, FILES)
    monkeypatch.delenv("EVODRIVE_CACHE", raising=False)
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    monkeypatch.setattr("tempfile.tempdir", None)
    return tmp_path


def on_slurm(place):
    """What a task of an array says, and whether it counts as one of a machine that lacks something."""
    env = {**os.environ, "SLURM_ARRAY_JOB_ID": "1", "SLURM_ARRAY_TASK_ID": "0", "SLURM_JOB_ID": "1"}
    words = ["bash", str(HERE.parent / "evodrive_cluster/task.sbatch"), *(str(place / name) for name in ("list", "logs", f"travel/{DIGEST}"))]
    ended = subprocess.run(words, env=env, check=False)
    return (place / "logs/1_0.log").read_text(), ended.returncode


def on_ray(place):
    try:
        folder = unpacked(DIGEST, lambda: FILES)
    except PermissionError as refused:
        return str(refused), 69
    return subprocess.run([folder / "evodrive"], capture_output=True, text=True, check=True).stdout, 0


def theirs(path, owner=OTHER):
    if os.getuid() != 0:
        pytest.skip("only root can give a file to another user")
    os.chown(path, owner, owner, follow_symlinks=False)


def planted(place, mode=0o755):
    """The cache as somebody may have made it who knows the name."""
    folder = place / f"tmp/evodrive-{os.getuid()}" / DIGEST
    write_whole_folder(folder, {**FILES, NAMES: json.dumps(sorted(FILES)).encode()})
    (folder / "evodrive").write_text(FOREIGN)
    for path in (folder, folder.parent):
        path.chmod(mode)
    return folder


def other_cache(place):
    theirs(planted(place).parent)


def other_folder(place):
    theirs(planted(place))


def other_file(place):
    folder = planted(place)
    (folder / "evodrive").write_bytes(HONEST)
    theirs(folder / "evodrive")


def open_cache(place):
    planted(place).parent.chmod(0o777)


def open_file(place):
    folder = planted(place)
    (folder / "evodrive").write_bytes(HONEST)
    (folder / "evodrive").chmod(0o777)


def linked_cache(place):
    planted(place).parent.rename(place / "elsewhere")
    (place / f"tmp/evodrive-{os.getuid()}").symlink_to(place / "elsewhere")


def linked_folder(place):
    folder = planted(place)
    folder.rename(place / "elsewhere")
    folder.symlink_to(place / "elsewhere")


def linked_file(place):
    folder = planted(place)
    (place / "elsewhere").write_bytes(HONEST)
    (place / "elsewhere").chmod(0o755)
    (folder / "evodrive").unlink()
    (folder / "evodrive").symlink_to(place / "elsewhere")


def open_parent(place):
    (place / "tmp").chmod(0o777)
    theirs(place / "tmp")


def other_parent(place):
    theirs(place / "tmp")


PLANTED = [other_cache, other_folder, other_file, open_cache, open_file, linked_cache, linked_folder, linked_file, open_parent, other_parent]


@pytest.mark.parametrize("runs", [on_slurm, on_ray])
def test_what_came_is_kept_for_its_user_alone_and_runs_each_time(place, runs):
    for _ in range(2):
        said, code = runs(place)
        assert "the honest binary runs" in said and code == 0, said
    kept = place / f"tmp/evodrive-{os.getuid()}"
    assert kept.stat().st_mode & 0o777 == 0o700
    # What a planner leaves beside its files is no fault of theirs.
    (kept / DIGEST / "planner/__pycache__").mkdir()
    (kept / DIGEST / "planner/log").write_text("drove")
    assert runs(place)[1] == 0


@pytest.mark.parametrize("plant", PLANTED, ids=lambda plant: plant.__name__)
@pytest.mark.parametrize("runs", [on_slurm, on_ray])
def test_nothing_is_executed_that_somebody_else_could_have_put_there(place, runs, plant):
    plant(place)
    said, code = runs(place)
    assert code == 69 and "code runs" not in said and "honest" not in said, said
    assert str(place / "tmp") in said and "EVODRIVE_CACHE" in said, said


@pytest.mark.parametrize("runs", [on_slurm, on_ray])
@pytest.mark.parametrize("change", ["evodrive", "planner/deep/main.py", None])
def test_what_is_not_the_files_of_its_name_is_not_executed(place, runs, change):
    assert runs(place)[1] == 0
    folder = place / f"tmp/evodrive-{os.getuid()}" / DIGEST
    if change:
        (folder / change).write_text(FOREIGN)
    else:
        (folder / "experiment.toml").unlink()
    said, code = runs(place)
    assert code == 69 and "code runs" not in said and "remove the folder" in said, said


def test_a_bundle_on_the_shared_disk_that_was_changed_does_not_travel(tmp_path):
    options = Namespace(installed=None)
    bundle = Slurm(options, FILES, tmp_path / "shards").bundle
    (bundle / "evodrive").write_text(FOREIGN)
    with pytest.raises(Stopped, match="not what the folder's name says"):
        Slurm(options, FILES, tmp_path / "shards")


def test_of_many_that_write_one_new_file_one_does(tmp_path):
    for number in range(20):
        wrote, path = [], tmp_path / f"{number}.json"
        threads = [threading.Thread(target=lambda text: wrote.append((write_new(path, text), text)), args=(bytes([n]) * 1000,)) for n in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert [text for is_new, text in wrote if is_new] == [path.read_bytes()]
    assert len(list(tmp_path.iterdir())) == 20, "nothing half made stays"


def test_a_driver_takes_the_place_of_one_that_was_killed_and_of_no_other(tmp_path):
    def driver():
        return Driver(Namespace(experiment=str(tmp_path / "study.toml"), out=str(tmp_path / "runs"), evodrive="evodrive", by="task"), None)

    driver().guard()
    path = driver_file(driver().options)
    with pytest.raises(Stopped, match="another driver"):
        driver().guard()
    path.write_text(path.read_text().replace(f'"pid": {os.getpid()}', '"pid": 99999999'))
    driver().guard()
    assert f'"pid": {os.getpid()}' in path.read_text() and [entry.name for entry in path.parent.iterdir()] == [path.name]
