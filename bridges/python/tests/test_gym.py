"""Environments: Gymnasium's own checks, what is handed out held against rollouts of the program, and every bad input."""

import json
import multiprocessing
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import evodrive
import evodrive.gym as eg
from evodrive import _evodrive
from evodrive.runs import command

HOME = Path(__file__).resolve().parents[3]
WEIGHTS = HOME / "policies/sac-metadrive.safetensors"


@pytest.fixture(scope="module")
def src(pools):
    own, closed = pools
    return eg.Scenarios(own, {"plain": None, "cat": "cat"}, {"plain": 0.3, "cat": 0.7}, held_out=closed)


def along_the_route(obs, observation):
    """As in `evodrive bench env`: keeps to the route at a steady speed."""
    one = np.float32
    if observation == "metadrive-1":
        steering, speed = obs[:, 4] * one(4.5) - obs[:, 3] * one(0.6), obs[:, 0] * one(20)
    else:
        turn = -obs[:, 1] if observation == "safebench-2" else obs[:, 1]
        steering, speed = turn * one(2.7) - obs[:, 0] * one(0.3), obs[:, 2]
    return np.clip(np.stack([steering, (one(8) - speed) * one(0.5)], 1), one(-1), one(1))


def test_the_package_says_its_version_and_is_typed():
    assert evodrive.__version__ == _evodrive.__version__
    assert (Path(evodrive.__file__).parent / "py.typed").exists()
    assert not Path(evodrive.driver.__file__).is_symlink() if hasattr(evodrive, "driver") else True


@pytest.mark.parametrize("observation", ["metadrive-1", "safebench-1", "safebench-2", "arrays-1"])
def test_gymnasium_s_checker_passes(src, observation):
    env = eg.make("evodrive/Adversarial-v0", scenarios=src, observation=observation, render_mode="rgb_array", width=240)
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("mode", ["same_step", "next_step", "disabled"])
@pytest.mark.parametrize("observation", ["metadrive-1", "safebench-1", "safebench-2"])
def test_a_vector_is_its_environments_side_by_side(src, mode, observation):
    """Against single environments with the same seeds and actions, step by step."""
    n, reward = 5, eg.MetaDriveReward(crash=30.0)
    vec = eg.VecEnv(src, n, observation=observation, reward=reward, autoreset=mode, seed=40, preventable=True)
    ones = [eg.AdversarialEnv(src, observation, reward, seed=40 + i, preventable=True) for i in range(n)]
    obs, info = vec.reset()
    assert obs.dtype == np.float32 and obs.shape == (n, {"metadrive-1": 126}.get(observation, 4))
    for i, one in enumerate(ones):
        alone, told = one.reset()
        assert np.array_equal(obs[i], alone)
        assert src.scenes[info["scene"][i]] == told["scene"] and src.program_names[info["program"][i]] == told["program"]
    over, ended = np.zeros(n, bool), 0
    for _ in range(400):
        actions = along_the_route(obs, observation)
        before = obs.copy()
        obs, rewards, terminated, truncated, info = vec.step(actions)
        for i, one in enumerate(ones):
            if mode == "next_step" and over[i]:
                alone, _ = one.reset()
                assert np.array_equal(obs[i], alone) and rewards[i] == 0.0 and not (terminated[i] or truncated[i])
                continue
            alone, worth, end, cut, told = one.step(actions[i])
            assert (rewards[i], terminated[i], truncated[i]) == (worth, end, cut)
            if end or cut:
                ended += 1
                final = info["final_info"] if mode == "same_step" else info
                last = info["final_obs"] if mode == "same_step" else obs
                assert np.array_equal(last[i], alone)
                assert eg.ENDS[final["end"][i]] == told["end"]
                assert final["route_completion"][i] == np.float32(told["route_completion"])
                assert final["episode_return"][i] == told["episode_return"]
                assert {-1: None, 0: False, 1: True}[int(final["preventable"][i])] == told["preventable"]
                if mode == "same_step":
                    assert info["_final_obs"][i] and info["_final_info"][i]
                    alone, _ = one.reset()
            if mode != "disabled" or not (end or cut):
                assert np.array_equal(obs[i], alone) or (end or cut)
        over = terminated | truncated
        if mode == "disabled" and over.any():
            obs, _ = vec.reset(options={"reset_mask": over})
            for i in np.flatnonzero(over):
                alone, _ = ones[i].reset()
                assert np.array_equal(obs[i], alone)
        assert vec.observation_space.contains(obs) and not np.array_equal(before, obs)
    assert ended > 10


def test_views_stay_during_the_next_step_where_they_are_asked_for(src):
    env = eg.VecEnv(src, 3, seed=1, copy=False)
    first, _ = env.reset()
    kept = first.copy()
    second = env.step(np.zeros((3, 2), np.float32))[0]
    assert np.array_equal(first, kept) and not np.shares_memory(first, second)
    third = env.step(np.zeros((3, 2), np.float32))[0]
    assert np.shares_memory(first, third), "views, not copies"


def test_the_numbers_are_the_engine_s_for_any_number_of_threads(pools, src):
    places, steps = 50, 2000
    told = {}
    for jobs in (1, 2):
        told[jobs] = command("bench", "env", "--pool", pools[0], "--places", places, "--steps", steps, "--digest", "--jobs", jobs)["digests"]
    assert told[1] == told[2]
    for observation, expected in told[1].items():
        for threads in (1, 2):
            env = eg.VecEnv(src, places, threads, observation, eg.MetaDriveReward(), "same_step", seed=0)
            obs, _ = env.reset()
            parts = []
            for _ in range(steps):
                obs, rewards, terminated, truncated, _ = env.step(along_the_route(obs, observation))
                parts += [obs.tobytes(), rewards.tobytes(), terminated.tobytes(), truncated.tobytes()]
            assert env.steps == places * steps == 100_000
            assert _evodrive.digest(b"".join(parts)) == expected, (observation, threads)


def test_arrays_are_in_the_ego_s_frame(src):
    env = eg.VecEnv(src, 4, observation="arrays-1", seed=2)
    obs, _ = env.reset()
    assert {name: of.shape for name, of in obs.items()} == {
        "ego": (4, 9), "route": (4, 20, 2), "neighbours": (4, 32, 10), "lanes": (4, 64, 6)
    }  # fmt: skip
    numbers, _ = eg.VecEnv(src, 4, observation="metadrive-1", seed=2).reset()
    assert np.allclose(obs["ego"][:, 0], numbers[:, 0] * 20.0, atol=1e-4), "speed, m/s"
    near = obs["neighbours"]
    far = np.hypot(near[..., 1], near[..., 2])
    assert all(np.all(np.diff(far[i][near[i, :, 0] == 1]) >= -1e-4) for i in range(4)), "the nearest first"
    assert np.allclose(numbers[:, 67:69] * 50.0, near[:, 0, 1:3], atol=1e-3), "the nearest road user is the same one"
    for _ in range(30):
        obs, *_ = env.step(np.tile(np.float32([0.0, 0.3]), (4, 1)))
        assert env.observation_space.contains({name: np.ascontiguousarray(of) for name, of in obs.items()})


def test_an_episode_of_the_environment_is_a_rollout_of_the_program(src):
    """The shipped ego, driven from Python by its own weights, has the figures that the program gives it."""
    from safetensors.numpy import load_file

    w = load_file(WEIGHTS)
    env = eg.AdversarialEnv(src)
    figures = eg.evaluate(WEIGHTS, src)
    plain = {"contact": 0, "completion": []}
    for scene in src.scenes:
        obs, _ = env.reset(options={"program": "plain", "scene": scene})
        over = False
        while not over:
            x = obs.astype(np.float64)
            for layer in ("latent_pi.0", "latent_pi.2"):
                x = np.maximum(w[f"{layer}.weight"] @ x + w[f"{layer}.bias"], 0.0)
            obs, _, end, cut, info = env.step(np.tanh(w["mu.weight"] @ x + w["mu.bias"]).astype(np.float32))
            over = end or cut
        plain["contact"] += info["end"] == "contact"
        plain["completion"].append(info["route_completion"])
    assert plain["contact"] / len(src.scenes) == figures["plain"]["crash_rate"]
    # Sums of another order: the last digits of an action differ, and so the ends by a hair.
    assert np.mean(plain["completion"]) == pytest.approx(figures["plain"]["route_completion"], abs=1e-3)
    assert {"attack", "strict_realism", "coverage"} <= set(figures["cat"]) and "attack" not in figures["plain"]


def test_evaluate_is_apply(pools, src, tmp_path):
    program = tmp_path / "cat.json"
    command("program", "new", "--family", "cat", "--out", program)
    told = command("apply", program, "--scenes", pools[1], "--ego", WEIGHTS)
    ours = eg.evaluate(WEIGHTS, src.held_out)["cat"]
    assert json.dumps(told).count(repr(ours["attack"])) >= 1
    assert ours["labelled"] <= len(src.held_out) and 0.0 <= ours["crash_rate"] <= 1.0
    still = eg.evaluate("standing", src.held_out)["plain"]
    assert still["arrival_rate"] == 0.0 and still["route_completion"] < 0.5


def test_weights_of_arrays_drive_as_they_were_saved(src, tmp_path):
    from safetensors.numpy import load_file

    path = eg.save_policy(load_file(WEIGHTS), tmp_path / "again.safetensors")
    assert eg.evaluate(path, src) == eg.evaluate(WEIGHTS, src)
    with pytest.raises(ValueError, match="mu.weight"):
        eg.save_policy({"latent_pi.0.weight": [[1.0]], "latent_pi.0.bias": [0.0]}, path)
    with pytest.raises(ValueError, match="expected 4 inputs"):
        eg.save_policy(load_file(WEIGHTS), path, observation="safebench-1")
    with pytest.raises(ValueError, match="drive by metadrive-1, expected safebench-1"):
        eg.save_policy(str(WEIGHTS), path, observation="safebench-1")


def test_adversaries_are_planned_again_around_the_policy(pools):
    src = eg.Scenarios(pools[0], {"cat": "cat"}, plan_around="policy", replan_every=400)
    runs = []
    for _ in range(2):
        env = eg.VecEnv(src, 20, seed=3)
        env.policy = str(WEIGHTS)
        obs, _ = env.reset()
        seen = []
        for _ in range(120):
            obs, *_ = env.step(along_the_route(obs, "metadrive-1"))
            seen.append(obs.copy())
        runs.append(np.array(seen))
    assert np.array_equal(*runs), "which step a plan comes in at does not depend on time"
    fixed = eg.VecEnv(eg.Scenarios(pools[0], {"cat": "cat"}), 20, seed=3)
    obs, _ = fixed.reset()
    around_idm = []
    for _ in range(120):
        obs, *_ = fixed.step(along_the_route(obs, "metadrive-1"))
        around_idm.append(obs.copy())
    same = [np.array_equal(a, b) for a, b in zip(runs[0], around_idm)]
    assert all(same[:20]) and not all(same), "from some step on the adversaries are others"
    env = eg.VecEnv(src, 20, seed=3)
    env.reset()
    with pytest.raises(RuntimeError, match="env.policy"):
        for _ in range(21):
            env.step(np.zeros((20, 2), np.float32))


def test_a_picture_shows_the_moment(src):
    env = eg.make(scenarios=src, render_mode="rgb_array", width=300)
    env.reset(seed=5)
    first = env.render()
    assert first.dtype == np.uint8 and first.shape[1:] == (300, 3) and first.std() > 5
    for _ in range(10):
        env.step(np.float32([0.0, 1.0]))
    later = env.render()
    assert later.shape == first.shape and (later != first).mean() > 0.01


def test_scenarios_travel_to_another_process(src):
    import pickle

    again = pickle.loads(pickle.dumps(src))
    seen = [eg.VecEnv(of, 3, seed=9).reset()[0] for of in (src, again)]
    assert np.array_equal(*seen) and again.held_out.ids == src.held_out.ids


def test_an_episode_opens_in_scenes_show_with_the_same_labels(pools, src, tmp_path):
    env = eg.VecEnv(src, 6, seed=4, keep=True, preventable=True)
    obs, _ = env.reset()
    for _ in range(120):
        obs, *_ = env.step(along_the_route(obs, "metadrive-1"))
    for i in range(6):
        file = tmp_path / f"{i}.json"
        file.write_text(env.episode(i))
        told = json.loads(file.read_text())
        shown = command("scenes", "show", pools[0], "--scene", told["scene"], "--episode", file)
        assert shown["outcome"] == told["outcome"] and len(told["controls"]) == told["outcome"]["steps"]
    command("scenes", "draw", pools[0], "--scene", told["scene"], "--episode", file, "--out", tmp_path / "strip.svg")
    assert "<svg" in (tmp_path / "strip.svg").read_text()
    told["controls"][0] = [0.0, 0.3 if told["controls"][0][1] < 0.1 else -0.3]
    file.write_text(json.dumps(told))
    with pytest.raises(evodrive.EvodriveError, match="recorded"):
        command("scenes", "show", pools[0], "--episode", file)


def test_scenes_of_both_pools_are_refused(pools):
    with pytest.raises(ValueError, match="stands in both pools"):
        eg.Scenarios(pools[0], held_out=pools[0])
    src = eg.Scenarios(pools[0], held_out=pools[1])
    assert not set(src.scenes) & set(src.held_out.ids)
    with pytest.raises(TypeError, match="held-out"):
        eg.VecEnv(src.held_out)


def test_every_bad_input_is_an_exception_that_says_what_was_expected(pools, src, tmp_path):
    env = eg.VecEnv(src, 3, seed=0)
    with pytest.raises(RuntimeError, match="before the first reset"):
        env.step(np.zeros((3, 2), np.float32))
    env.reset()
    for bad, error, said in [
        (np.full((3, 2), np.nan, np.float32), ValueError, r"place 0: action\[0\] is NaN"),
        (np.float32([[0, 0], [0, 1.5], [0, 0]]), ValueError, r"place 1: action\[1\] is 1.5; expected a number from -1 to 1"),
        (np.zeros((2, 2), np.float32), ValueError, r"shape \(2, 2\); expected \(3, 2\)"),
        (np.zeros(6, np.float32), ValueError, "shape"),
        (np.zeros((3, 2), complex), TypeError, "complex"),
        (np.full((3, 2), "a"), TypeError, "same_kind"),
    ]:
        with pytest.raises(error, match=said):
            env.step(bad)
    env.step(np.zeros((3, 2), np.float32))
    with pytest.raises(ValueError, match="seeds for 3"):
        env.reset(seed=[1, 2])
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": np.zeros(3, bool)})
    with pytest.raises(ValueError, match="no scene 'nowhere'"):
        env.reset(options={"scene": "nowhere"})
    with pytest.raises(ValueError, match="no program"):
        env.reset(options={"program": "nobody", "scene": src.scenes[0]})
    env.close()
    with pytest.raises(RuntimeError, match="closed"):
        env.step(np.zeros((3, 2), np.float32))
    over = eg.VecEnv(src, 1, autoreset="disabled", seed=0)
    over.reset()
    with pytest.raises(RuntimeError, match="its episode is over"):
        for _ in range(500):
            over.step(np.float32([[1.0, 1.0]]))
    for options, said in [
        (dict(observation="metadrive-2"), "metadrive-1, safebench-1, safebench-2 and arrays-1"),
        (dict(autoreset="sometimes"), "same_step"),
        (dict(num_envs=0), "1 to"),
        (dict(reward=eg.MetaDriveReward(crash=float("nan"))), "reward"),
    ]:
        with pytest.raises(ValueError, match=said):
            eg.VecEnv(src, **{"num_envs": 2, **options})
    with pytest.raises(TypeError, match="Scenarios"):
        eg.VecEnv("my.pool", 2)
    for options, said in [
        (dict(pool=tmp_path / "none.pool"), "none.pool"),
        (dict(programs={"x": tmp_path / "x.json"}), "x.json"),
        (dict(programs={"x": "human"}), "staged"),
        (dict(programs={"x": "nobody"}), "nobody"),
        (dict(programs={}), "empty"),
        (dict(mix={"y": 1.0}), "mix names"),
        (dict(mix={"plain": -1.0}, programs={"plain": None}), "share"),
        (dict(plan_around="policy"), "replan_every"),
        (dict(plan_around="me"), "no driver"),
        (dict(plant="moon"), "physical"),
    ]:
        with pytest.raises((ValueError, OSError), match=said):
            eg.VecEnv(eg.Scenarios(**{"pool": pools[0], **options}), 2)
    (tmp_path / "odd.safetensors").write_bytes(b"12345678")
    with pytest.raises(ValueError, match="save_policy"):
        eg.evaluate(tmp_path / "odd.safetensors", src)


def test_a_fault_within_the_engine_closes_the_environment(src):
    env = eg.VecEnv(src, 3, seed=0)
    obs, _ = env.reset()
    with pytest.raises(RuntimeError, match="a fault within it .asked for at 3 places.; please report it; the environment is closed"):
        env._engine.native._fault()
    for call in (lambda: env.step(np.zeros((3, 2), np.float32)), env.reset):
        with pytest.raises(RuntimeError, match="the environment is closed: a fault"):
            call()
    assert obs.shape == (3, 126) and np.isfinite(obs).all(), "what was handed out stays"


def _steps(env, answers):
    try:
        env.step(np.zeros((4, 2), np.float32))
        answers.put("stepped")
    except RuntimeError as error:
        answers.put(str(error))


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
@pytest.mark.filterwarnings("ignore:This process")
def test_a_forked_process_is_told_to_make_its_own(src):
    env = eg.VecEnv(src, 4, seed=0)
    env.reset()
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=_steps, args=(env, answers))
    child.start()
    assert "fork" in answers.get(timeout=60)
    child.join()
    env.step(np.zeros((4, 2), np.float32))


def test_wrappers_of_gymnasium_take_it(src):
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(eg.VecEnv(src, 8, autoreset="next_step", seed=1))
    obs, _ = env.reset()
    returns = []
    for _ in range(200):
        obs, _, _, _, info = env.step(along_the_route(obs, "metadrive-1"))
        if "episode" in info:
            returns += info["episode"]["r"][info["_episode"]].tolist()
    assert len(returns) > 5


def test_gymnasium_makes_vectors_of_it_in_one_process_and_in_several(src):
    one = gymnasium.make_vec(eg.ID, num_envs=2, vectorization_mode="vector_entry_point", scenarios=src)
    several = gymnasium.make_vec(eg.ID, num_envs=2, vectorization_mode="async", vector_kwargs={"context": "spawn"}, scenarios=src)
    try:
        seen = [env.reset(seed=1)[0].copy() for env in (one, several)]
        assert isinstance(one, eg.VecEnv) and np.array_equal(*seen)
        steps = [env.step(np.zeros((2, 2), np.float32)) for env in (one, several)]
        assert np.array_equal(steps[0][0], steps[1][0]) and np.array_equal(steps[0][1], steps[1][1])
    finally:
        several.close()


def test_scenes_of_safebench_s_families_under_its_programs(tmp_path):
    src = eg.Scenarios(eg.generate(tmp_path / "staged.pool", 0, 7, protocol="safebench"), {"plain": None, "human": "human"})
    env = eg.VecEnv(src, 16, observation="safebench-1", reward=eg.SafeBenchReward(), autoreset="same_step", seed=0, preventable=True)
    obs, _ = env.reset()
    ends = set()
    for _ in range(250):
        obs, rewards, _, _, info = env.step(along_the_route(obs, "safebench-1"))
        assert np.isfinite(rewards).all()
        if "final_info" in info:
            ends |= {eg.ENDS[end] for end in info["final_info"]["end"][info["_final_info"]]}
    assert {"contact", "arrived"} <= ends
    told = eg.evaluate("idm", src)
    assert "ARS" in told["human"] and told["human"]["crash_rate"] > told["plain"]["crash_rate"]


def test_the_program_travels_in_the_package():
    done = subprocess.run([sys.executable, "-m", "evodrive", "families", "--json"], capture_output=True, text=True)
    assert done.returncode == 0 and "cat" in done.stdout
    bad = subprocess.run([sys.executable, "-m", "evodrive", "no-such-command"], capture_output=True, text=True)
    assert bad.returncode == 2 and "no-such-command" in bad.stderr


def test_programs_are_evolved_against_a_policy(pools, tmp_path):
    src = eg.Scenarios(pools[0])
    (found,) = eg.evolve(WEIGHTS, src, ["cat"], out=tmp_path, epochs=1, slots=2)
    assert found.path.exists() and (found.run / "result.json").exists() and found.family == "cat"
    assert set(found.parent) == {"attack", "realism"}
    again = eg.Scenarios(pools[0], {"evolved": found}, plan_around=str(WEIGHTS))
    assert again.coverage()["evolved"]["planned"] > 0
    with pytest.raises(FileExistsError):
        eg.evolve(WEIGHTS, src, ["cat"], out=tmp_path)
