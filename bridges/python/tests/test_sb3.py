"""Stable-Baselines3 and torch with the environments; skipped where they are not installed."""

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

import evodrive.gym as eg

pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed (.ci/python --full)")
HOME = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("observation", ["metadrive-1", "safebench-1"])
def test_the_checker_of_sb3_passes(pools, observation):
    from stable_baselines3.common.env_checker import check_env

    check_env(eg.AdversarialEnv(eg.Scenarios(pools[0]), observation, seed=0), warn=False)


@pytest.mark.parametrize("kind", ["PPO", "SAC", "TD3"])
def test_a_model_drives_from_its_file_as_it_predicts(pools, tmp_path, kind):
    import stable_baselines3
    import torch

    torch.manual_seed(0)
    src = eg.Scenarios(pools[0])
    env = eg.sb3(eg.VecEnv(src, 8, seed=1))
    options = {"policy_kwargs": {"net_arch": [32, 32]}, "seed": 0, "device": "cpu"}
    options |= {"n_steps": 64} if kind == "PPO" else {"learning_starts": 200, "batch_size": 32}
    model = getattr(stable_baselines3, kind)("MlpPolicy", env, **options).learn(1024)
    path = eg.save_policy(model, tmp_path / f"{kind}.safetensors")
    figures = eg.evaluate(path, src)["plain"]
    one, crashes, completion = eg.AdversarialEnv(src), 0, []
    for scene in src.scenes:
        obs, _ = one.reset(options={"scene": scene})
        over = False
        while not over:
            action, _ = model.predict(obs, deterministic=True)
            obs, _, end, cut, info = one.step(action)
            over = end or cut
        crashes += info["end"] == "contact"
        completion.append(info["route_completion"])
    # Sums of another order: the last digits differ.
    assert np.mean(completion) == pytest.approx(figures["route_completion"], abs=0.02)
    assert abs(crashes / len(src.scenes) - figures["crash_rate"]) <= 1.5 / len(src.scenes)


def test_the_example_trains(pools, tmp_path, monkeypatch):
    script = "sb3_ppo.py"
    path = HOME / "examples/train" / script
    assert len(path.read_text().splitlines()) <= 60
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [script, str(pools[0]), str(pools[1]), "--steps", "4096", "--envs", "32"])
    runpy.run_path(str(path), run_name="__main__")
    assert list(tmp_path.glob("*.safetensors"))


def test_the_readme_s_lines_train(tmp_path, monkeypatch, capsys):
    text = (HOME / "bridges/python/README.md").read_text()
    lines = text.split("```python\n", 1)[1].split("```", 1)[0]
    assert sum(bool(line.strip()) for line in lines.splitlines()) <= 8
    for written, short in [("count=400", "count=30"), ("count=100", "count=10"), (".learn(20_000)", ".learn(640)")]:
        assert written in lines
        lines = lines.replace(written, short)
    monkeypatch.chdir(tmp_path)
    exec(compile(lines, "README.md", "exec"), {})
    assert "crash_rate" in capsys.readouterr().out and (tmp_path / "mine.safetensors").exists()


def test_modules_and_models_of_other_shapes_drive_within_python(pools):
    import torch
    from stable_baselines3 import PPO
    from torch import nn

    torch.manual_seed(0)
    src = eg.Scenarios(pools[0])
    shallow = nn.Sequential(nn.Linear(126, 16), nn.ReLU(), nn.Linear(16, 2), nn.Tanh())

    def same(obs):
        with torch.no_grad():
            return shallow(torch.from_numpy(obs)).numpy()

    assert eg.evaluate(shallow, src) == eg.evaluate(same, src)

    class Encoder(nn.Module):
        def forward(self, obs):
            return torch.stack([obs["ego"][:, 4], 0.2 + 0 * obs["ego"][:, 0]], 1)

    assert eg.evaluate(Encoder(), src, observation="arrays-1")["plain"]["scenes"] == len(src.scenes)
    deep = PPO("MlpPolicy", eg.sb3(eg.VecEnv(src, 2)), policy_kwargs={"net_arch": [8, 8, 8]}, device="cpu", seed=0)
    predicts = lambda obs: deep.predict(obs, deterministic=True)[0]
    assert eg.evaluate(deep, src) == eg.evaluate(predicts, src)
    with pytest.raises(ValueError, match=r"shape \(24, 3\) for 24 observations; expected numbers of shape \(24, 2\)"):
        eg.evaluate(nn.Linear(126, 3), src)


@pytest.mark.parametrize("discrete", [eg.Discrete(3, 3), eg.Discrete(3, 5, multi=True)], ids=str)
def test_ppo_trains_and_is_evaluated_with_numbers_and_stacks(pools, tmp_path, discrete):
    from stable_baselines3 import PPO

    src, stack = eg.Scenarios(pools[0]), eg.Observation(stack=2)
    env = eg.sb3(eg.VecEnv(src, 8, seed=1, actions=discrete, observation=stack, render_mode="rgb_array", width=200))
    model = PPO("MlpPolicy", env, policy_kwargs={"net_arch": [16, 16]}, n_steps=64, seed=0, device="cpu")
    before = [of.detach().clone() for of in model.policy.parameters()]
    model.learn(1024)
    assert any((a != b).any() for a, b in zip(before, model.policy.parameters()))
    assert len(env.get_images()) == 8
    figures = eg.evaluate(model, src, stack, actions=discrete)["plain"]
    predicts = lambda obs: model.predict(obs, deterministic=True)[0]
    assert eg.evaluate(predicts, src, stack, actions=discrete)["plain"] == figures and figures["scenes"] == len(src.scenes)
    with pytest.raises(ValueError, match=r"the model's actions are (Multi)?Discrete\(.*evaluate\(model, scenes, actions=...\) drives it"):
        eg.save_policy(model, tmp_path / "no.safetensors")


def test_what_torch_exports_of_comparisons_and_activations_drives(pools, tmp_path):
    import torch
    from torch import nn

    pytest.importorskip("onnxscript", reason="torch exports with onnxscript, which is not installed")

    class Steered(nn.Module):
        """Keeps to the route, by way of a function of one number that hardly changes what is small."""

        def __init__(self, through):
            super().__init__()
            self.through = through

        def forward(self, obs):
            pedal = torch.where((obs[:, :1] > 0.4) | (obs[:, 8:9] >= 0.8) & ~(obs[:, :1] < 0.1), -0.5, 0.5)
            turn = obs[:, 4:5] * 4.5 - obs[:, 3:4] * 0.6
            return torch.cat([torch.where(turn.abs() <= 1, self.through(turn), turn.sign()), pedal], 1)

    src, seen = eg.Scenarios(pools[0]), set()
    for through in [nn.LeakyReLU(0.5), nn.Hardtanh(-0.2, 0.2), nn.ReLU6(), nn.PReLU(1, 0.3), nn.SELU(), nn.CELU(2.0), nn.Mish(), nn.Hardswish(),
                    nn.Hardsigmoid(), nn.Softsign(), nn.Hardshrink(0.02), nn.Threshold(0.01, 0.0), nn.Softplus(), nn.LogSigmoid()]:  # fmt: skip
        module, file = Steered(through).eval(), tmp_path / "mine.onnx"
        torch.onnx.export(module, (torch.zeros(1, 126),), str(file), external_data=False, verbose=False)
        expected, found = eg.evaluate(module, src)["plain"], eg.evaluate(file, src)["plain"]
        # Functions are rounded otherwise in torch: the last digits differ.
        assert found["route_completion"] == pytest.approx(expected["route_completion"], abs=0.01), through
        seen.add(round(found["route_completion"], 3))
    assert len(seen) > 6, "they drive differently"


def test_the_mix_of_a_training_is_set_through_the_adapter(pools):
    env = eg.sb3(eg.VecEnv(eg.Scenarios(pools[0], {"plain": None, "cat": "cat"}), 3))
    env.set_mix({"cat": 1.0})
    assert env.get_attr("mix")[0] == {"plain": 0.0, "cat": 1.0}
