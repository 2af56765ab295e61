"""The shipped baseline driver, in scenes that it was neither trained in nor chosen by; and its recipe in short form."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

import evodrive.gym as eg

HOME = Path(__file__).resolve().parents[3] / "examples/train"


@pytest.fixture(scope="module")
def unseen(tmp_path_factory):
    return eg.Scenarios(eg.generate(tmp_path_factory.mktemp("unseen") / "unseen.pool", 60, 404))


def beats_idm(driver, scenes):
    own, idm = (eg.evaluate(of, scenes)["plain"] for of in (driver, "idm"))
    return own["route_completion"] > idm["route_completion"] and own["crash_rate"] <= idm["crash_rate"]


def test_the_shipped_driver_beats_idm(unseen):
    assert beats_idm(HOME / "baseline.safetensors", unseen)


def test_weights_of_zero_do_not(unseen):
    shapes = {"latent_pi.0": (8, 126), "latent_pi.2": (8, 8), "mu": (2, 8)}
    zeros = {f"{of}.{part}": np.zeros(n[: 2 - k]) for of, n in shapes.items() for k, part in enumerate(("weight", "bias"))}
    assert not beats_idm(zeros, unseen)


def test_the_recipe_trains(tmp_path, monkeypatch, capsys):
    pytest.importorskip("torch", reason="torch is not installed (.ci/python --full)")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", "baseline.py --steps 4096 --envs 32 --scenes 24 --held-out 12 12".split())
    runpy.run_path(str(HOME / "baseline.py"), run_name="__main__")
    assert "test  idm" in capsys.readouterr().out and (tmp_path / "baseline.safetensors").exists()


def test_the_loop_trains_evolves_and_compares(tmp_path, monkeypatch, capsys):
    pytest.importorskip("torch", reason="torch is not installed (.ci/python --full)")
    monkeypatch.chdir(tmp_path)
    eg.generate("open.pool", 16, 7), eg.generate("closed.pool", 12, 8)
    monkeypatch.setattr(sys, "argv", "loop.py open.pool closed.pool --steps 2048 --envs 32 --seeds 2 --epochs 1".split())
    runpy.run_path(str(HOME.parent / "loop.py"), run_name="__main__")
    out = capsys.readouterr().out
    rows = [line.split("  ")[0].strip() for line in out.splitlines()]
    assert {"first half", "plain again", "parents", "evolved", "PDM-hard", "IDM", "PDM", "standing still"} <= set(rows)
    assert out.count("beside plain again: ") == 3
