"""The checks of docs/QUALITY.md, "Entrances", at the package: each is named as in the table's head."""

import json
import subprocess
import sys

import numpy as np
import pytest

import evodrive.gym as eg
from evodrive import _evodrive


def arrays(width=8, inputs=126, outputs=2, **changed):
    shapes = {"latent_pi.0": (width, inputs), "latent_pi.2": (width, width), "mu": (outputs, width)}
    layers = {f"{name}.weight": np.zeros(shape, np.float32) for name, shape in shapes.items()}
    layers |= {f"{name}.bias": np.zeros(shape[0], np.float32) for name, shape in shapes.items()}
    return layers | changed


def test_weights(tmp_path):
    """What the reader refuses is not written."""
    path = tmp_path / "actor.safetensors"
    infinite = np.full(2, np.inf, np.float32)
    odd = [
        arrays(inputs=5), arrays(outputs=3), arrays(outputs=0), arrays(width=0), arrays(width=2000),
        arrays(**{"latent_pi.2.weight": np.zeros((8, 7), np.float32)}), arrays(**{"mu.bias": infinite}),
        arrays(**{"mu.weight": np.zeros((0, 0), np.float32), "mu.bias": np.zeros(0, np.float32)}),
    ]  # fmt: skip
    for actor in odd:
        with pytest.raises(ValueError, match="expected"):
            eg.save_policy(actor, path)
        assert not path.exists()
    eg.save_policy(arrays(), path)
    assert _evodrive.weights_observation(path.read_bytes()) == "metadrive-1"


def test_threads(pools):
    with pytest.raises(ValueError, match="at most 1024 worker threads, found 1000000000000"):
        eg.Scenarios(pools[0], threads=10**12)
    src = eg.Scenarios(pools[0])
    for threads in (1025, 10**12):
        with pytest.raises(ValueError, match="at most 1024 worker threads"):
            eg.VecEnv(src, 2, threads=threads)


def test_scene(tmp_path):
    """A scene beyond all bounds is left out."""
    far = tmp_path / "far.json"
    position = [{"x": 1e7 * k, "y": 0.0, "z": 0.0} for k in range(30)]
    one = {"id": 7, "type": "vehicle", "length": 4.6, "width": 1.9, "heading": [0.0] * 30, "valid": [True] * 30,
           "position": position, "velocity": [{"x": 10.0, "y": 0.0}] * 30}  # fmt: skip
    far.write_text(json.dumps({
        "name": "far", "scenario_id": "far", "objects": [one, one | {"id": 9}], "tl_states": {},
        "roads": [{"id": 50, "map_element_id": 2, "type": "lane", "geometry": [{"x": -20.0, "y": 0.0}, {"x": 90.0, "y": 0.0}]}],
        "metadata": {"sdc_track_index": 0, "objects_of_interest": []},
    }))  # fmt: skip
    with pytest.raises(ValueError, match="expected usable scenes, found none"):
        eg.Scenarios(far)


def test_cut(tmp_path):
    """An error's text is bounded."""
    with pytest.raises(ValueError) as refused:
        eg.evaluate("a" * 3_000_000, eg.Scenarios(eg.generate(tmp_path / "x.pool", 12, 7)))
    assert len(str(refused.value)) < 40_000


def test_name():
    """The program within the package."""
    words = [sys.executable, "-m", "evodrive", "run", b"caf\xe9.toml"]
    ran = subprocess.run(words, capture_output=True)
    assert ran.returncode == 2 and b'expected UTF-8, found "caf\\xE9.toml"' in ran.stderr, ran.stderr
