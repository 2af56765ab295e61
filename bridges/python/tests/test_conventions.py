"""What Gymnasium's users take for granted: wrappers, copies, pickles, types; and a curriculum, rewards and policies of one's own."""

import copy
import math
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import vector as wrappers

import evodrive.gym as eg

ACTION = np.float32([0.05, 0.4])


@pytest.fixture(scope="module")
def src(pools):
    own, closed = pools
    return eg.Scenarios(own, {"plain": None, "cat": "cat"}, {"plain": 0.3, "cat": 0.7}, held_out=closed)


def run(env, steps, action=ACTION, reset=True):
    """All that an environment gives in so many steps of one action."""
    one = isinstance(env.unwrapped, gymnasium.Env)
    told = [env.reset(seed=3)] if reset else []
    for _ in range(steps):
        told.append(env.step(action if one else np.tile(action, (env.num_envs, 1))))
        over = told[-1][2] | told[-1][3]
        if one and over:
            told.append(env.reset())
        elif not one and over.any() and env.metadata["autoreset_mode"].name == "DISABLED":
            told.append(env.reset(options={"reset_mask": over}))
    return told


WRAPPERS = {
    "NormalizeObservation": wrappers.NormalizeObservation,
    "TransformObservation": lambda env: wrappers.TransformObservation(env, lambda obs: obs),
    "FlattenObservation": wrappers.FlattenObservation,
    "RescaleObservation": lambda env: wrappers.RescaleObservation(env, np.float32(-1), np.float32(1)),
}


@pytest.mark.parametrize("name", WRAPPERS)
def test_gymnasium_s_wrappers_of_observations_take_a_vector(src, name):
    env = WRAPPERS[name](eg.VecEnv(src, 4))
    seen = [told[0] for told in run(env, 120)]
    assert all(env.observation_space.contains(obs) for obs in seen)
    plain = [told[0] for told in run(eg.VecEnv(src, 4), 120)]
    assert len(seen) == len(plain)
    if name in ("TransformObservation", "FlattenObservation"):
        assert np.array_equal(seen, plain)
    # It is Gymnasium that knows these wrappers in no other mode: the last observation of what ended would pass them by.
    with pytest.raises(ValueError, match="NEXT_STEP"):
        WRAPPERS[name](eg.VecEnv(src, 4, autoreset="same_step"))


def test_a_dictionary_is_flattened(src):
    env = wrappers.FlattenObservation(eg.VecEnv(src, 3, observation="arrays-1"))
    assert all(env.observation_space.contains(told[0]) for told in run(env, 60))


def holds_its_own(env):
    """What was handed out is neither written over later, nor shared, nor the engine's: writing into it changes nothing."""
    kept = run(env, 150)
    copies = copy.deepcopy(kept)
    kept += run(env, 150)
    np.testing.assert_equal(kept[: len(copies)], copies)
    arrays = []
    collect = lambda of: [collect(x) for x in (of.values() if isinstance(of, dict) else of)] if isinstance(of, (dict, tuple, list)) else arrays.append(of)
    collect(kept)
    arrays = [of for of in arrays if isinstance(of, np.ndarray)]
    assert len({of.ctypes.data for of in arrays}) == len(arrays), "two that were handed out are one"
    for of in arrays:
        of.fill(1)
    np.testing.assert_equal(run(env, 150), copies)
    return kept


@pytest.mark.parametrize("observation", ["metadrive-1", "arrays-1"])
@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled"])
def test_what_an_environment_hands_out_is_a_copy(src, mode, observation):
    kept = holds_its_own(eg.VecEnv(src, 3, observation=observation, autoreset=mode, cost=lambda of: 1.0))
    assert (mode == "same_step") == any("final_obs" in told[-1] for told in kept), "an episode ended"
    with pytest.raises((AssertionError, ValueError)):  # the check finds views
        holds_its_own(eg.VecEnv(src, 3, observation=observation, autoreset=mode, copy=False))


def worth(record):
    return record["progress_m"] - 0.1 * abs(record["steering"])


@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copied", "pickled"])
@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled", None])
def test_a_copied_environment_goes_on_as_the_original(src, mode, again):
    options = {"keep": True, "preventable": True, "by_failure": 9.0, "reward": worth, "cost": worth, "out_of_bounds": "clip"}
    env = eg.AdversarialEnv(src, **options) if mode is None else eg.VecEnv(src, 5, autoreset=mode, **options)
    if mode is None:
        env = gymnasium.wrappers.TimeLimit(env, 70)
    else:
        fresh = again(env)
        np.testing.assert_equal(run(fresh, 3), run(env, 3))
    run(env, 130)
    other = again(env)
    of = lambda env: [env.unwrapped.episode(*([i] if mode else [])) for i in range(5 if mode else 1)]
    assert of(env) == of(other) and any(of(env))
    np.testing.assert_equal(run(other, 200, ACTION * 2, reset=False), run(env, 200, ACTION * 2, reset=False))
    assert of(env) == of(other) and np.array_equal(env.unwrapped.scene_weights, other.unwrapped.scene_weights)
    env.close()
    run(other, 1, reset=False)  # the copy is an environment of its own


def test_a_copy_has_the_plans_that_are_made_and_the_mix_that_was_set(pools):
    src = eg.Scenarios(pools[0], {"cat": "cat"}, plan_around="policy", replan_every=400)
    env = eg.VecEnv(src, 10)
    env.policy = {name: np.zeros(shape, np.float32) for name, shape in {
        "latent_pi.0.weight": (8, 126), "latent_pi.0.bias": 8, "latent_pi.2.weight": (8, 8), "latent_pi.2.bias": 8,
        "mu.weight": (2, 8), "mu.bias": 2}.items()}  # fmt: skip
    run(env, 50)  # one plan is begun
    env.set_mix({"plain": 1.0, "cat": 1.0}, {"plain": None})
    other = pickle.loads(pickle.dumps(env))
    np.testing.assert_equal(run(other, 150, reset=False), run(env, 150, reset=False))
    assert other.mix == env.mix == {"cat": 1.0, "plain": 1.0}


def test_a_spec_is_json_and_makes_the_same_again(src):
    options = {"observation": "safebench-1", "reward": eg.SafeBenchReward(collision=7.0), "max_episode_steps": 30}
    env = eg.make(scenarios=src, **options)
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    np.testing.assert_equal(run(again, 60), run(env, 60))
    several = gymnasium.make_vec(eg.ID, num_envs=2, vectorization_mode="vector_entry_point", scenarios=src)
    assert '"cat"' in several.spec.to_json()


EXAMPLE = """
import numpy as np
import evodrive.gym as eg

def cost(record: eg.Record) -> float:
    return 1.0 if record["end"] == "contact" else 0.0

def still(obs: np.ndarray[tuple[int, int], np.dtype[np.float32]]) -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    return np.zeros((len(obs), 2), np.float32)

eg.generate("open.pool", count=4, seed=1)
src = eg.Scenarios("open.pool", {"plain": None, "cat": "cat"}, held_out=["closed.pool"])
env = eg.VecEnv(src, num_envs=2, reward=eg.MetaDriveReward(crash=30.0), cost=cost, out_of_bounds="clip", by_failure=4.0)
obs, info = env.reset(seed=1, options={"program": "cat", "scene": src.scenes[0]})
obs, rewards, terminated, truncated, info = env.step(np.zeros((2, 2), np.float32))
total: float = float(rewards.sum())
env.set_mix({"plain": 0.5, "cat": 0.5, "new": 1.0}, programs={"new": "new.json"})
rate: float = eg.evaluate(still, src.held_out)["cat"]["crash_rate"]
one = eg.make(scenarios=src)
first, _ = one.reset(seed=3)
alone = eg.AdversarialEnv(src, render_mode="rgb_array")
seen, reward, ended, cut, told = alone.step([0.0, 1.0])
picture = alone.render()
few = eg.Discrete(steering=5, pedal=3, multi=True)
drawn = eg.VecEnv(src, 2, actions=few, observation=eg.Observation("arrays-1", stack=2, goal=True), render_mode="rgb_array")
pictures = drawn.render([1])
assert pictures is not None and pictures[0].shape[2] == 3
by_number = eg.evaluate(lambda obs: np.zeros((len(obs), 2), np.int64), src, eg.Observation(stack=4), actions=few)
made = eg.make(scenarios=src, actions=eg.Discrete(table=[[0.0, 1.0], [0.0, -1.0]]))
training = eg.sb3(env)
several = eg.parallel_env(src, agents=4, others="idm", reward=cost, render_mode="rgb_array", observation=eg.Observation(neighbours=8))
frame = several.render()
seen_by, infos = several.reset(seed=1)
seen_by, worth, ends, cuts, infos = several.step({agent: [0.0, 1.0] for agent in several.agents})
eg.save_policy({"mu.weight": np.zeros((2, 8))}, "mine.safetensors")
"""


def test_an_example_passes_mypy_strict(tmp_path):
    pytest.importorskip("mypy", reason="mypy is not installed")
    (tmp_path / "example.py").write_text(EXAMPLE)
    words = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), "example.py"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    (tmp_path / "example.py").write_text(EXAMPLE + 'env.reset(seed="one")\ntotal = env.step(None)\n')
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.stdout.count("error:") >= 2, "types are looked at"


@pytest.mark.parametrize("make", [lambda src, **of: eg.VecEnv(src, 1, **of), eg.AdversarialEnv], ids=["many", "one"])
def test_actions_out_of_bounds_are_clipped_or_refused(src, make):
    shaped = lambda env, action: np.float32([action] if isinstance(env, eg.VecEnv) else action)
    clips, refuses, bounded = make(src, out_of_bounds="clip"), make(src), make(src)
    for env in (clips, refuses, bounded):
        env.reset(seed=1)
    with pytest.raises(ValueError, match="expected a number from -1 to 1"):
        refuses.step(shaped(refuses, [7.0, 0.5]))
    for action in ([7.0, -0.5], [-np.inf, 2.0], [0.0, 1.0]):
        np.testing.assert_equal(clips.step(shaped(clips, action)), bounded.step(shaped(bounded, np.clip(action, -1, 1))))
    with pytest.raises(ValueError, match="NaN"):
        clips.step(shaped(clips, [np.nan, 0.0]))
    with pytest.raises(ValueError, match="out_of_bounds is 'wrap'; expected 'raise' or 'clip'"):
        make(src, out_of_bounds="wrap")


def test_the_mix_changes_while_training(src, tmp_path):
    env = eg.VecEnv(src, 8)
    untouched = eg.VecEnv(src, 8)
    np.testing.assert_equal(run(env, 100), run(untouched, 100))
    env.set_mix(dict(src.mix))
    np.testing.assert_equal(run(env, 100, reset=False), run(untouched, 100, reset=False))
    env.set_mix({"plain": 0.0, "cat": 1.0})
    before = env.step(np.zeros((8, 2), np.float32))[-1]["program"]
    assert 0 in before, "what was begun goes on"
    assert (env.reset()[1]["program"] == 1).all()
    from evodrive.runs import command

    command("program", "new", "--family", "king", "--out", tmp_path / "king.json")
    env.set_mix({"new": 1.0}, {"new": tmp_path / "king.json"})
    assert (env.reset()[1]["program"] == 2).all() and env.scenarios.program_names == ["plain", "cat", "new"]
    assert env.reset(options={"program": "cat", "scene": src.scenes[0]})[1]["program"][0] == 1
    assert src.mix == {"plain": 0.3, "cat": 0.7} and src.program_names == ["plain", "cat"], "what others drive stays"
    one = eg.make(scenarios=src)
    one.set_mix({"cat": 1})
    assert {one.reset()[1]["program"] for _ in range(12)} == {"cat"}
    for of in (env, one):
        with pytest.raises(AttributeError, match="set_mix"):
            of.mix = {"plain": 1.0}
    with pytest.raises(AttributeError, match="set_mix"):
        src.mix = {"plain": 1.0}
    with pytest.raises(TypeError):
        src.mix["plain"] = 1.0
    held = dict(env.mix)
    for mix, programs, said in [
        ({"nobody": 1.0}, None, "mix names"),
        ({"cat": 0.0}, None, "share above 0"),
        ({"cat": math.nan}, None, "share"),
        ({"new": 1.0}, {"new": "human"}, "rules|staged"),
        ({"new": 1.0}, {"new": tmp_path / "none.json"}, "none.json"),
    ]:
        with pytest.raises((ValueError, OSError), match=said):
            env.set_mix(mix, programs)
        assert env.mix == held
        env.reset(), env.step(np.zeros((8, 2), np.float32))


def failing(src, by_failure, threads=1, steps=1200):
    """Which share of the later episodes is in scenes in which this driver fails, and what came up."""
    env = eg.VecEnv(src, 16, threads, by_failure=by_failure)
    ends, order = {}, []
    for _, _, _, _, info in run(env, steps)[1:]:
        for i in np.flatnonzero(info["end"] >= 0):
            scene, is_failed = int(info["scene"][i]), eg.ENDS[info["end"][i]] in ("contact", "off_road")
            order.append(scene)
            assert ends.setdefault(scene, is_failed) == is_failed, "the same action always"
    late = [ends[scene] for scene in order[len(order) // 3 :]]
    return sum(late) / len(late), order, env.scene_weights, ends


def prefers_failures(src, by_failure):
    share, order, weights, ends = failing(src, by_failure)
    assert 0 < sum(ends.values()) < len(ends), "some scenes are failed, some are not"
    evenly = failing(src, 1.0)[0]
    assert 1 - share < 0.5 * (1 - evenly), (share, evenly)
    assert all((weights[scene] > 1.0) == is_failed for scene, is_failed in ends.items())
    return order


def test_scenes_that_are_failed_come_up_more_often(pools):
    src = eg.Scenarios(pools[0])
    order = prefers_failures(src, 20.0)
    assert order == failing(src, 20.0, threads=2)[1], "the same for any number of threads"
    with pytest.raises(AssertionError):  # the check finds who ignores the weights
        prefers_failures(src, 1.0)
    for found in (0.5, math.nan, 1e300):
        with pytest.raises(ValueError, match="by_failure is .*expected 1 to 1000000"):
            eg.VecEnv(src, 2, by_failure=found)


@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled"])
def test_a_function_says_what_a_step_is_worth_and_costs(src, mode):
    seen = []
    cost = lambda record: seen.append(record) or float(record["end"] == "contact")
    env = eg.VecEnv(src, 4, autoreset=mode, reward=lambda record: 2.0 * record["reward"], cost=cost)
    sums = np.zeros(4)
    for told, plain in zip(run(env, 250)[1:], run(eg.VecEnv(src, 4, autoreset=mode), 250)[1:]):
        if len(told) == 2:
            continue  # a reset
        (_, rewards, terminated, truncated, info), over = told, told[2] | told[3]
        assert np.array_equal(rewards, 2.0 * plain[1])
        sums += rewards
        final = info if mode != "same_step" else info.get("final_info")
        if over.any():
            assert np.array_equal(info["cost"][over], (final["end"][over] == 0).astype(float))
            np.testing.assert_allclose(final["episode_return"][over], sums[over], rtol=1e-12)
        assert not info["cost"][~over].any()
        sums[over] = 0.0
    assert {"end", "scene", "program", "speed_mps", "progress_m", "route_completion", "reward"} <= set(seen[0])
    assert {record["end"] for record in seen} >= {None, "contact"} and seen[0]["scene"] in src.scenes
    one = eg.AdversarialEnv(src, reward=lambda record: -1.0, cost=lambda record: record["speed_mps"])
    steps = [told for told in run(one, 150) if len(told) == 5]
    assert {told[1] for told in steps} == {-1.0} and all(told[4]["cost"] >= 0.0 for told in steps)
    assert next(told[4] for told in steps if told[2] or told[3])["episode_return"] < -3.0


@pytest.mark.parametrize("make", [lambda src, **of: eg.VecEnv(src, 2, **of), eg.AdversarialEnv], ids=["many", "one"])
@pytest.mark.parametrize("name", ["reward", "cost"])
def test_a_function_that_breaks_says_so_and_the_environment_stays_usable(src, make, name):
    bad = {"value": 0.0}
    env = make(src, **{name: lambda record: record["x"] if bad["value"] == "raise" else bad["value"]})
    action = np.zeros((2, 2) if isinstance(env, eg.VecEnv) else 2, np.float32)
    for value, error, said in [
        ("raise", RuntimeError, f"{name} raised KeyError in environment 0 .*expected a finite number"),
        (math.nan, ValueError, f"{name} was nan in environment 0; expected a finite number"),
        (None, RuntimeError, f"{name} raised TypeError"),
    ]:
        bad["value"] = 0.0
        env.reset(seed=1)
        env.step(action)
        bad["value"] = value
        with pytest.raises(error, match=said):
            env.step(action)
        bad["value"] = 0.0
        with pytest.raises(RuntimeError, match=r"expected reset\(\) before the next step"):
            env.step(action)
    np.testing.assert_equal(run(env, 30), run(make(src, **{name: lambda record: 0.0}), 30))
    with pytest.raises(TypeError, match=f"{name} is a str; expected"):
        make(src, **{name: "speed"})


def zeros(hidden=8):
    shapes = {"latent_pi.0": (hidden, 126), "latent_pi.2": (hidden, hidden), "mu": (2, hidden)}
    layers = {f"{name}.weight": np.zeros(shape, np.float32) for name, shape in shapes.items()}
    return layers | {f"{name}.bias": np.zeros(shape[0], np.float32) for name, shape in shapes.items()}


def test_a_function_drives_as_the_same_policy_in_a_file(src, tmp_path):
    counts = []

    def policy(obs):
        counts.append(len(obs))
        assert obs.dtype == np.float32 and obs.shape[1:] == (126,)
        return np.tile(ACTION, (len(obs), 1))

    file = eg.save_policy(zeros() | {"mu.bias": ACTION}, tmp_path / "same.safetensors", squash="clip")
    ours = eg.evaluate(policy, src.held_out)
    assert ours == eg.evaluate(file, src.held_out) and "attack" in ours["cat"]
    assert max(counts) == len(src.held_out), "all scenes at once"
    arrays = lambda obs: np.zeros((len(obs["ego"]), 2))
    assert eg.evaluate(arrays, src, observation="arrays-1") == eg.evaluate(zeros(), src)


def test_a_policy_that_breaks_says_what_was_expected(src):
    for policy, error, said in [
        (lambda obs: np.zeros(2), ValueError, r"float64 of shape \(2,\) for 12 observations; expected numbers of shape \(12, 2\)"),
        (lambda obs: np.full((len(obs), 2), "a"), ValueError, "expected numbers of shape"),
        (lambda obs: np.full((len(obs), 2), np.nan), ValueError, r"nan as action\[0, 0\]; expected finite numbers"),
        (lambda obs: obs["ego"], IndexError, ""),
    ]:
        with pytest.raises(error, match=said):
            eg.evaluate(policy, src.held_out)
    with pytest.raises(ValueError, match="metadrive-2"):
        eg.evaluate(lambda obs: obs, src.held_out, observation="metadrive-2")


def test_a_policy_drives_scenes_of_safebench_s_families(tmp_path):
    src = eg.Scenarios(eg.generate(tmp_path / "staged.pool", 0, 7, protocol="safebench"), {"plain": None, "human": "human"})
    told = eg.evaluate(lambda obs: np.full((len(obs), 2), 0.2), src, observation="safebench-1")
    assert told["human"]["scenes"] > 0 and "attack" not in told["human"]
