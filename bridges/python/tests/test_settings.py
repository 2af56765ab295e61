"""Actions by number, observations with settings of one's own, pictures of vectors: each held against what it stands for."""

import copy
import math
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.wrappers import FrameStackObservation

import evodrive.gym as eg

MODES = ["next_step", "same_step", "disabled"]
TABLE = [[0.0, 1.0], [0.0, -1.0], [0.4, 0.2], [-0.4, 0.2], [0.0, 0.0], [0.05, 0.3]]


@pytest.fixture(scope="module")
def src(pools):
    own, closed = pools
    return eg.Scenarios(own, {"plain": None, "cat": "cat"}, {"plain": 0.3, "cat": 0.7}, held_out=closed)


def run(env, steps, action, reset=True):
    """All that a vector gives; `action(step)` is everybody's, or an array of them."""
    given = [env.reset(seed=3)] if reset else []
    for step in range(steps):
        given.append(env.step(action(step)))
        over = given[-1][2] | given[-1][3]
        if over.any() and env.metadata["autoreset_mode"].name == "DISABLED":
            given.append(env.reset(options={"reset_mask": over}))
    return given


def meant(discrete, number):
    """Steering and pedal of a number, said once more: MetaDrive's order, steering first."""
    if discrete.table is not None:
        return discrete.table[number]
    value = lambda i, count: i * 2 / (count - 1) - 1
    if not discrete.multi:
        number = number % discrete.steering, number // discrete.steering
    return value(number[0], discrete.steering), value(number[1], discrete.pedal)


def drives_as_meant(src, mode, discrete, meant):
    env, plain = eg.VecEnv(src, 4, autoreset=mode, actions=discrete), eg.VecEnv(src, 4, autoreset=mode)
    env.action_space.seed(1)
    drawn = [env.action_space.sample() for _ in range(90)]
    values = [np.float32([meant(discrete, number) for number in row]) for row in drawn]
    assert env.action_space.contains(drawn[0]) and len({of.tobytes() for of in drawn}) > 80
    found = run(env, 90, lambda step: drawn[step])
    assert any((told[2] | told[3]).any() for told in found if len(told) == 5), "an episode ended"
    np.testing.assert_equal(found, run(plain, 90, lambda step: values[step]))


@pytest.mark.parametrize("discrete", [eg.Discrete(), eg.Discrete(3, 4), eg.Discrete(4, 3, multi=True), eg.Discrete(table=TABLE)], ids=str)
@pytest.mark.parametrize("mode", MODES)
def test_numbers_drive_as_the_values_that_they_mean(src, mode, discrete):
    drives_as_meant(src, mode, discrete, meant)
    with pytest.raises(AssertionError):  # the check finds another order
        drives_as_meant(src, mode, discrete, lambda of, number: meant(of, number)[::-1])


def test_one_environment_takes_numbers_and_says_so_in_its_spec(src):
    assert eg.make(scenarios=src, actions=eg.Discrete(3, 5)).action_space == gymnasium.spaces.Discrete(15)
    assert eg.VecEnv(src, 2, actions=eg.Discrete(3, 5, multi=True)).single_action_space == gymnasium.spaces.MultiDiscrete([3, 5])
    env = eg.make(scenarios=src, actions=eg.Discrete(table=TABLE), observation=eg.Observation("arrays-1", stack=2, goal=True))
    again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
    plain = eg.make(scenarios=src, observation=eg.Observation("arrays-1", stack=2, goal=True))
    drive = lambda env, of: [env.reset(seed=4), *(env.step(of(number % 6)) for number in range(6))]
    expected = drive(plain, lambda number: np.float32(TABLE[number]))
    np.testing.assert_equal(drive(env, lambda number: number), expected)
    np.testing.assert_equal(drive(again, np.int64), expected)
    other = pickle.loads(pickle.dumps(env))
    np.testing.assert_equal(other.step(2), env.step(2))


def test_numbers_outside_are_refused_by_name(src):
    env = eg.VecEnv(src, 3, actions=eg.Discrete())
    env.reset(seed=0)
    many = eg.VecEnv(src, 3, actions=eg.Discrete(5, 3, multi=True))
    many.reset(seed=0)
    one = eg.AdversarialEnv(src, actions=eg.Discrete())
    one.reset(seed=0)
    for of, actions, error, said in [
        (env, [0, 25, 0], ValueError, "environment 1: the action is 25; expected a number from 0 to 24"),
        (env, [0, 0, -1], ValueError, "environment 2: the action is -1; expected a number from 0 to 24"),
        (env, [0.0, 1.0, 2.0], TypeError, "actions are of float64; expected whole numbers: a number each"),
        (env, np.zeros((3, 2), int), ValueError, r"shape \(3, 2\); expected \(3,\): a number a row"),
        (many, [[0, 0], [4, 3], [0, 0]], ValueError, r"environment 1: action\[1\] is 3; expected a number from 0 to 2"),
        (many, np.zeros(3, int), ValueError, r"expected \(3, 2\): the numbers of steering and pedal a row"),
        (one, 25, ValueError, "^the action is 25; expected a number from 0 to 24"),
        (one, [1, 2], ValueError, r"the action has the shape \(2,\); expected \(\): a number"),
        (one, 0.5, TypeError, "float64; expected whole numbers"),
    ]:
        with pytest.raises(error, match=said):
            of.step(actions)
    assert env.steps == many.steps == 0, "nothing moved"
    env.step(np.uint8([24, 0, 12]))
    for options, said in [
        ({"steering": 1}, "steering is 1; expected a number of values from 2 to 1000"),
        ({"pedal": 2.5}, "pedal is 2.5; expected a number"),
        ({"multi": "yes"}, "multi is 'yes'"),
        ({"table": TABLE, "multi": True}, "multi goes with steering and pedal"),
        ({"table": [[0, 2]]}, r"the table is \[\[0, 2\]\]; expected 1 to 1000 rows of steering and pedal, numbers from -1 to 1"),
        ({"table": [[0, math.nan]]}, "the table is"),
        ({"table": [[0, 0], [0]]}, "the table is"),
        ({"table": []}, "the table is"),
        ({"table": "left"}, "the table is 'left'"),
    ]:
        with pytest.raises(ValueError, match=said):
            eg.Discrete(**options)
    with pytest.raises(TypeError, match="actions is 25; expected evodrive.gym.Discrete, or None"):
        eg.VecEnv(src, 2, actions=25)


def test_what_nobody_reads_may_be_any_number(src):
    """With "next_step" the action of a place whose episode ended is ignored, as Gymnasium has it."""
    env = eg.VecEnv(src, 4, actions=eg.Discrete())
    env.reset(seed=3)
    over = np.zeros(4, bool)
    while not over.any():
        _, _, terminated, truncated, _ = env.step(np.full(4, 24))
        over = terminated | truncated
    env.step(np.where(over, 99, 24))
    with pytest.raises(ValueError, match="the action is 99"):
        env.step(np.full(4, 99))


def test_policies_of_numbers_are_evaluated_and_no_files(src):
    numbers = lambda obs: np.where(obs[:, 0] * 20 > 8, 10, 22)
    values = lambda obs: np.where(obs[:, :1] * 20 > 8, np.float32([-1.0, 0.0]), np.float32([0.0, 1.0]))
    assert eg.evaluate(numbers, src.held_out, actions=eg.Discrete()) == eg.evaluate(values, src.held_out)
    for policy, error, said in [
        (lambda obs: np.full(len(obs), 25), ValueError, "the policy, observation 0: the action is 25; expected a number from 0 to 24"),
        (values, ValueError, r"expected numbers of shape \(12,\): a number a row"),
        ("idm", TypeError, "'idm' gives steering and pedal; actions= goes with a function"),
    ]:
        with pytest.raises(error, match=said):
            eg.evaluate(policy, src.held_out, actions=eg.Discrete())


def stacked(given, k, mode):
    """Observations of so many moments, of a run of single ones."""
    frames, expected, over, ended = None, [], None, 0
    for told in given:
        obs = told[0]
        if frames is None:
            frames = [[row] * k for row in obs]
        else:
            final = told[4].get("final_obs") if mode == "same_step" and len(told) == 5 else None
            for i, row in enumerate(obs):
                begins = over[i] if mode == "next_step" or len(told) == 2 else mode == "same_step" and (told[2] | told[3])[i]
                if final is not None and begins:
                    expected.append((i, [*frames[i][1:], final[i]]))
                if not (len(told) == 2 and not begins):  # a masked reset is no moment of the others
                    frames[i] = [row] * k if begins else [*frames[i][1:], row]
                ended += begins
        expected.append(np.array(frames))
        over = told[2] | told[3] if len(told) == 5 else np.zeros(len(obs), bool)
    assert ended > 4, ended
    return expected


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("observation", ["metadrive-1", "safebench-2"])
def test_a_stack_holds_the_newest_moments_of_its_own_episode(src, mode, observation):
    action = lambda step: np.tile(np.float32([0.03, 0.5]), (6, 1))
    env = eg.VecEnv(src, 6, 2, observation=eg.Observation(observation, stack=3), autoreset=mode)
    found = run(env, 150, action)
    assert all(env.observation_space.contains(told[0]) for told in found)
    expected = stacked(run(eg.VecEnv(src, 6, observation=observation, autoreset=mode), 150, action), 3, mode)
    for told in found:
        if mode == "same_step" and len(told) == 5 and "final_obs" in told[4]:
            for i in np.flatnonzero(told[4]["_final_obs"]):
                place, last = expected.pop(0)
                assert place == i and np.array_equal(told[4]["final_obs"][i], last)
        assert np.array_equal(told[0], expected.pop(0))
    assert not expected


@pytest.mark.parametrize("observation", ["metadrive-1", "arrays-1"])
def test_a_stack_of_one_environment_is_gymnasium_s(src, observation):
    own = eg.AdversarialEnv(src, eg.Observation(observation, stack=4))
    theirs = FrameStackObservation(eg.AdversarialEnv(src, observation), 4, padding_type="reset")
    assert own.observation_space == theirs.observation_space
    for episode in range(4):
        seed = 8 if episode == 0 else None
        seen, expected, over = own.reset(seed=seed), theirs.reset(seed=seed), False
        while not over:
            np.testing.assert_equal(seen, expected)
            seen, expected = own.step(np.float32([0.0, 0.4])), theirs.step(np.float32([0.0, 0.4]))
            over = seen[2] or seen[3]
        np.testing.assert_equal(seen, expected)


@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copied", "pickled"])
@pytest.mark.parametrize("mode", MODES)
def test_a_copy_has_the_moments_of_the_original_and_draws_the_same(src, mode, again):
    options = {"observation": eg.Observation("arrays-1", stack=5, goal=True), "actions": eg.Discrete(), "render_mode": "rgb_array", "width": 200}
    env = eg.VecEnv(src, 3, autoreset=mode, **options)
    run(env, 60, lambda step: np.full(3, 17))
    other = again(env)
    np.testing.assert_equal(other.render(), env.render())
    found = [run(of, 60, lambda step: np.full(3, 12), reset=False) for of in (other, env)]
    np.testing.assert_equal(*found)
    assert sum((told[2] | told[3]).sum() for told in found[0] if len(told) == 5) > 0


def test_settings_that_are_the_standard_ones_are_the_standard_observation(src):
    for standard, given in [
        ("metadrive-1", eg.Observation()),
        ("metadrive-1", eg.Observation("metadrive-1", neighbours=6)),
        ("safebench-2", eg.Observation("safebench-2")),
        ("arrays-1", eg.Observation("arrays-1", neighbours=32, range_m=100, lanes=64, lanes_range_m=60.0)),
    ]:
        envs = [eg.AdversarialEnv(src, of) for of in (standard, given)]
        np.testing.assert_equal(*[[env.reset(seed=1), env.step(np.float32([0, 1]))] for env in envs])
        assert envs[0].observation_space == envs[1].observation_space
        assert repr(eg.VecEnv(src, 2, observation=given)).startswith(f"VecEnv(2 environments, {standard}, ")


def observations(src, *given):
    """The same moments, seen differently."""
    envs, step = [eg.VecEnv(src, 8, observation=of, autoreset="same_step") for of in given], np.tile(np.float32([0.02, 0.6]), (8, 1))
    yield [env.reset(seed=6)[0] for env in envs]
    for _ in range(60):
        yield [env.step(step)[0] for env in envs]


def test_how_many_are_described_one_by_one_is_a_setting(src):
    more = False
    for standard, few, many, arrays in observations(
        src, "metadrive-1", eg.Observation(neighbours=2), eg.Observation(neighbours=20), eg.Observation("arrays-1", range_m=50)
    ):
        assert few.shape == (8, 86) and many.shape == (8, 266)
        assert np.array_equal(few, standard[:, :86]) and np.array_equal(many[:, :126], standard)
        rows = many[:, 66:].reshape(8, 20, 10)
        assert np.array_equal(rows[..., 0], arrays["neighbours"][:, :20, 0])
        assert np.allclose(rows[..., 1:3] * 50, np.clip(arrays["neighbours"][:, :20, 1:3], -50, 50), atol=1e-3)
        more |= bool(rows[:, 6:, 0].any())
    assert more, "somebody beyond the sixth"


def test_how_far_and_how_much_arrays_show_are_settings(src):
    given = eg.Observation("arrays-1", neighbours=5, range_m=25, lanes=200, lanes_range_m=30, goal=True)
    near, ended, cut = 0, 0, 0
    for standard, own, wide in observations(src, "arrays-1", given, eg.Observation("arrays-1", lanes=256, lanes_range_m=300)):
        assert own["neighbours"].shape == (8, 5, 10) and own["lanes"].shape == (8, 200, 6) and own["goal"].shape == (8, 3)
        assert np.array_equal(own["ego"], standard["ego"]) and np.array_equal(own["route"], standard["route"])
        for i in range(8):
            rows = standard["neighbours"][i]
            rows = rows[(rows[:, 0] == 1) & (np.hypot(rows[:, 1], rows[:, 2]) <= 25)][:5]
            assert np.array_equal(own["neighbours"][i][: len(rows)], rows) and not own["neighbours"][i][len(rows) :].any()
            near += len(rows)
            within = lambda of, m: of[(of[:, 0] == 1) & (np.hypot(of[:, 1] + of[:, 3], of[:, 2] + of[:, 4]) / 2 <= m)]
            assert np.array_equal(within(wide["lanes"][i], 60)[:64], within(standard["lanes"][i], math.inf))
            lanes = within(wide["lanes"][i], 30)[:200]
            assert np.array_equal(own["lanes"][i][: len(lanes)], lanes) and not own["lanes"][i][len(lanes) :].any()
            cut += len(lanes) < 200
            x, y, left_m = own["goal"][i]
            assert left_m == own["ego"][i][5] and np.hypot(x, y) <= left_m + 5
            if left_m < 50:
                assert np.allclose(own["route"][i][-1], [x, y], atol=1e-4), "where the route's last point is"
                ended += 1
    assert near > 50 and ended > 10 and cut > 10


def test_observations_of_one_s_own_are_evaluated_and_no_files(src, tmp_path):
    stack = eg.Observation(stack=2)
    plain = lambda obs: np.stack([0.4 * obs[:, 4], 0.4 - obs[:, 0]], 1)
    assert eg.evaluate(lambda obs: plain(obs[:, -1]), src.held_out, stack) == eg.evaluate(plain, src.held_out)
    # By the moment before: as an environment does it.
    figures, env, completion = eg.evaluate(lambda obs: plain(obs[:, 0]), src, stack)["plain"], eg.AdversarialEnv(src, stack), []
    for scene in src.scenes:
        obs, _ = env.reset(options={"program": "plain", "scene": scene})
        over = False
        while not over:
            obs, _, end, cut, info = env.step(np.clip(plain(obs[None, 0])[0], -1, 1))
            over = end or cut
        completion.append(info["route_completion"])
    assert np.mean(completion) == pytest.approx(figures["route_completion"], abs=1e-6)
    assert figures != eg.evaluate(plain, src)["plain"]
    arrays = {"latent_pi.0.weight": np.zeros((8, 252)), "latent_pi.0.bias": np.zeros(8), "mu.weight": np.zeros((2, 8)), "mu.bias": np.zeros(2)}
    for given in (stack, eg.Observation(neighbours=7), eg.Observation("arrays-1", goal=True)):
        said = r"Observation\(name=.* is no standard observation, and a file of weights knows only these; expected metadrive-1"
        with pytest.raises(ValueError, match=said):
            eg.save_policy(arrays, tmp_path / "no.safetensors", given)
        with pytest.raises(ValueError, match=said):
            eg.evaluate(arrays, src, given)
    for given, error, said in [
        ({"name": "metadrive-2"}, ValueError, "metadrive-1, safebench-1, safebench-2 and arrays-1"),
        ({"name": 3}, TypeError, "name is 3; expected the name of one"),
        ({"stack": 0}, ValueError, "stack is 0; expected a whole number from 1 to 64"),
        ({"stack": 1.5}, ValueError, "stack is 1.5; expected a whole number"),
        ({"stack": None}, TypeError, "stack is None; expected a number"),
        ({"neighbours": 65}, ValueError, "neighbours is 65; expected a whole number from 1 to 64"),
        ({"neighbours": "six"}, TypeError, "neighbours is 'six'; expected a number"),
        ({"range_m": 30}, ValueError, "range_m goes with arrays-1; metadrive-1 has none"),
        ({"goal": True}, ValueError, "goal goes with arrays-1"),
        ({"goal": 1}, TypeError, "goal is 1; expected True or False"),
        ({"name": "safebench-2", "neighbours": 2}, ValueError, "neighbours goes with metadrive-1 and arrays-1; safebench-2 has none"),
        ({"name": "arrays-1", "range_m": math.nan}, ValueError, "range_m is NaN; expected metres from 0 to 500"),
        ({"name": "arrays-1", "lanes": 1000}, ValueError, "lanes is 1000; expected a whole number from 1 to 256"),
        ({"name": "arrays-1", "lanes_range_m": -1}, ValueError, "lanes_range_m is -1; expected metres"),
    ]:
        with pytest.raises(error, match=said):
            eg.Observation(**given)
    with pytest.raises(TypeError, match="observation is 3; expected a name, or evodrive.gym.Observation"):
        eg.VecEnv(src, 2, observation=3)


@pytest.mark.parametrize("mode", MODES)
def test_a_vector_draws_each_of_its_environments(src, mode):
    env = eg.VecEnv(src, 3, autoreset=mode, render_mode="rgb_array", width=240)
    with pytest.raises(RuntimeError, match="render before the first reset"):
        env.render()
    ones = [eg.AdversarialEnv(src, render_mode="rgb_array", width=240) for _ in range(3)]
    env.reset(seed=20), [one.reset(seed=20 + i) for i, one in enumerate(ones)]
    action, over = np.float32([0.0, 0.8]), np.zeros(3, bool)
    for step in range(60):
        if step % 15 == 0:
            pictures = env.render()
            assert isinstance(pictures, tuple) and len({of.tobytes() for of in pictures}) == 3
            np.testing.assert_equal(pictures, tuple(one.render() for one in ones))
            np.testing.assert_equal(env.render([2, 0]), (pictures[2], pictures[0]))
        told = env.step(np.tile(action, (3, 1)))
        for i, one in enumerate(ones):
            if mode == "next_step" and over[i]:
                one.reset()
            else:
                one.step(action)
        over = told[2] | told[3]
        if mode == "disabled" and over.any():
            env.reset(options={"reset_mask": over})
        for i in np.flatnonzero(over) if mode != "next_step" else []:
            ones[i].reset()
    for indices in ([3], [-1], ["0"]):
        with pytest.raises(ValueError, match="no environment .*; expected numbers from 0 to 2"):
            env.render(indices)
    for options, said in [({"render_mode": "human"}, "render_mode is 'human'; expected None or 'rgb_array'"), ({"width": 100}, "width is 100")]:
        with pytest.raises(ValueError, match=said):
            eg.VecEnv(src, 2, **options)
    vector = gymnasium.make_vec(eg.ID, num_envs=2, vectorization_mode="vector_entry_point", scenarios=src, render_mode="rgb_array")
    vector.reset(seed=1)
    assert [of.shape[1:] for of in vector.render()] == [(480, 3)] * 2
