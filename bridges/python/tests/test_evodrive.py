"""Runs and their tables: the package against the program that it carries, on the quickstart and a small study."""

import json
import sys
from pathlib import Path

import pytest

import evodrive
from evodrive.runs import command

HOME = Path(__file__).resolve().parents[3]
QUICKSTART = HOME / "experiments/quickstart.toml"

PLANNER = """
from evodrive.driver import pursuit, serve

class Steady:
    def decide(self, scene, step):
        wanted = 2.0 - step["ego"]["speed_mps"]
        return max(-2.0, min(1.0, wanted)), pursuit(scene, step, 6.0)

serve(Steady())
"""


def small(folder, name, more=""):
    path = folder / f"{name}.toml"
    path.write_text(
        f'base = "{QUICKSTART}"\nname = "{name}"\ncassette = "{name}.jsonl"\n'
        "[split]\nevolution = { count = 6 }\nheld_out = 3\nwindow = 3\n"
        "[budget]\nepochs = 1\nslots = 2\nmax_repair_rounds = 0\nprobe_scenes = 1\nfinalists = 1\n"
        f'[scenes]\nsource = "synth"\ncount = 12\nseed = 7\n{more}'
    )
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    return folder, evodrive.record(small(folder, "mine"), out=folder / "runs", report=False)


def events(run, kind):
    lines = (run.folder / "transcript.jsonl").read_text().splitlines()
    return [event for event in map(json.loads, lines) if kind in event.get("kind", "")]


def test_a_recording_and_its_replay_are_one_run(recorded):
    folder, run = recorded
    again = evodrive.run(folder / "mine.toml", out=folder / "again", report=False, jobs=1)
    assert again.root == run.root and len(run.root) == 64
    assert evodrive.load(folder / "runs").folder == run.folder


def test_settings_reach_the_run(recorded):
    folder, run = recorded
    cassette = folder / "set.jsonl"
    other = evodrive.record(
        folder / "mine.toml", out=folder / "set", report=False, cassette=cassette, settings={"budget.slots": 1}
    )
    lineages = len(other.result["lineages"])
    assert (len(run.attempts()), len(other.attempts())) == (2 * lineages, lineages)


def test_frames_hold_what_the_result_says(recorded):
    _, run = recorded
    labels = run.labels()
    for lineage in run.result["lineages"]:
        for who in ("parent", "evolved"):
            of = labels[(labels.suite == "held_out") & (labels.solution == lineage[who]["solution"])]
            assert len(of) == lineage["held_out_scenes"]
            assert of.attack.mean() == pytest.approx(lineage[who]["objectives"]["attack"])
    assert str(labels.acted.dtype) == "boolean" and str(labels.attack.dtype) == "Float64"
    joined = labels.merge(run.rollouts(), on="record")
    assert len(joined) == labels.record.notna().sum()
    columns = run.dictionary().query("table == 'labels'").column.tolist()
    assert columns == labels.columns.tolist()


def test_a_failure_says_what_the_binary_said(recorded, tmp_path):
    with pytest.raises(evodrive.EvodriveError, match="no/such") as failed:
        evodrive.run("no/such.toml", out=tmp_path)
    assert failed.value.code == 2
    with pytest.raises(evodrive.EvodriveError, match="expected one of attempts"):
        recorded[1].table("lables")
    with pytest.raises(evodrive.EvodriveError, match="run.json"):
        evodrive.Run(tmp_path)


def test_a_planner_drives_with_the_package_s_helper(tmp_path):
    (tmp_path / "planner.py").write_text(PLANNER)
    driver = tmp_path / "planner.toml"
    driver.write_text(
        f'[driver]\ncommand = ["{sys.executable}", "planner.py"]\nfiles = ["planner.py"]\ncassette = "planner.jsonl.zst"\n'
        "timeout_s = 10\nprocesses = 1\nrepeat_share = 1.0\n"
    )
    told = command("egos", small(tmp_path, "drives"), "--driver", driver)
    speeds = {row["ego"]: row["figures"]["speed_mps"] for row in told["egos"]}
    (mine,) = (speed for name, speed in speeds.items() if "planner" in name)
    # It wants 2 m/s and begins at the recorded speed.
    assert 1.0 < mine < 0.8 * speeds["idm"], speeds


def test_the_helper_that_examples_copy_is_the_packages():
    import evodrive.driver

    own, example = Path(evodrive.driver.__file__), HOME / "examples/own_ego/evodrive_driver.py"
    assert own.read_bytes() == example.read_bytes() and not own.is_symlink()


def test_a_front_is_drawn(recorded, tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("svg")
    path = tmp_path / "front.svg"
    figure = evodrive.plot_front(recorded[1])
    figure.savefig(path)
    drawn = [tuple(line.get_xydata()[0]) for line in figure.axes[0].lines if line.get_marker() == "o" and len(line.get_xydata())]
    expected = [of["parent"]["objectives"] for of in recorded[1].result["lineages"]]
    assert drawn == [(of["realism"], of["attack"]) for of in expected]
    assert path.read_text().count("<path") > 4
    with pytest.raises(ValueError, match="expected one of"):
        evodrive.plot_front(recorded[1], "nobody")
