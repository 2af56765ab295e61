"""Several agents in one scene: PettingZoo's own tests, one agent held against a single environment, and every bad input."""

import copy
import math
import pickle
import sys

import numpy as np
import pytest

import evodrive.gym as eg

pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")
from pettingzoo.test import parallel_api_test, parallel_seed_test  # noqa: E402


@pytest.fixture(scope="module")
def src(pools):
    return eg.Scenarios(pools[0])


def along_the_route(obs):
    """Keeps to the route at a steady speed."""
    steering, speed = obs[4] * 4.5 - obs[3] * 0.6, obs[0] * 20
    return np.clip(np.float32([steering, (8 - speed) * 0.5]), -1, 1)


def episode(env, **options):
    """All that an episode gives, driven by what each agent sees."""
    obs, infos = env.reset(**options)
    told = [(obs, infos)]
    while env.agents:
        told.append(env.step({agent: along_the_route(obs[agent]) for agent in env.agents}))
        obs = told[-1][0]
    return told


@pytest.mark.parametrize("others", ["recorded", "idm"])
@pytest.mark.filterwarnings("ignore:options hold", "ignore:No agents present but not all possible_agents")
def test_pettingzoo_s_own_tests_pass(src, others):
    make = lambda: eg.parallel_env(src, agents=4, others=others)
    parallel_api_test(make(), 400)
    parallel_seed_test(make, 300)


def test_the_ego_alone_drives_as_in_a_single_environment(src):
    """To the end in scenes in which nobody turned reactive for the single one."""
    one, alike, ended = eg.AdversarialEnv(src), 0, set()
    env = eg.parallel_env(src, agents=1, reward=eg.MetaDriveReward())
    for scene in src.scenes:
        obs, info = one.reset(options={"scene": scene})
        expected = [obs]
        over = False
        while not over:
            obs, reward, terminated, truncated, info = one.step(along_the_route(obs))
            expected += [obs, reward, terminated, truncated]
            over = terminated or truncated
        told = episode(env, options={"scene": scene})
        found = [told[0][0]["agent_0"]] + [of["agent_0"] for step in told[1:] for of in step[:4]]
        assert np.array_equal(found[0], expected[0]) and found[2] == expected[2], "what is seen first, and the first reward"
        if len(found) == len(expected) and all(np.array_equal(a, b) for a, b in zip(found, expected)):
            alike += 1
            last = told[-1][4]["agent_0"]
            names = ("end", "contact_class", "scene")
            assert [last[name] for name in names] == [info[name] for name in names]
            assert last["route_completion"] == pytest.approx(info["route_completion"], abs=1e-6)
            ended.add(last["end"])
    assert alike >= 2 and len(ended) > 1, (alike, ended)


def test_agents_are_seen_by_each_other_and_leave_one_by_one(src):
    env, ends, met = eg.parallel_env(src, agents=6, seed=5), set(), 0
    for _ in range(12):
        told = episode(env)
        obs, infos = told[0]
        assert list(obs) == [f"agent_{i}" for i in range(len(obs))] and set(infos) == set(obs)
        assert all(env.observation_space(agent).contains(of) for agent, of in obs.items())
        assert len({info["track"] for info in infos.values()}) == len(infos)
        there = set(obs)
        for seen, rewards, terminated, truncated, infos in told[1:]:
            assert there == set(seen) == set(rewards) == set(terminated) == set(truncated) == set(infos)
            for agent, info in infos.items():
                assert env.observation_space(agent).contains(seen[agent]) and math.isfinite(rewards[agent])
                assert terminated[agent] == (info["end"] in ("contact", "off_road", "arrived"))
                assert truncated[agent] == (info["end"] == "horizon")
                assert (info["contact_class"] in eg.CONTACT_CLASSES) == (info["end"] == "contact")
                assert 0.0 <= info["route_completion"] <= 1.0
                if info["with"]:
                    met += 1
                    assert infos[info["with"]]["end"] == "contact", "both are told in the same step"
                ends.add(info["end"])
            there = {agent for agent in there if not terminated[agent] and not truncated[agent]}
    assert ends >= {None, "contact", "arrived"} and met > 0, (ends, met)


@pytest.mark.parametrize("observation", ["metadrive-1", "safebench-2", "arrays-1"])
def test_what_is_handed_out_is_the_caller_s_own_and_the_same_again(src, observation):
    action = np.float32([0.02, 0.3])

    def run(env):
        told = [env.reset(seed=3)]
        for _ in range(30):
            told.append(env.step({agent: action for agent in env.agents}))
            if not env.agents:
                told.append(env.reset())
        return told

    env = eg.parallel_env(src, 5, observation=observation, seed=9)
    first = run(env)
    for told in first:
        for of in told[0].values():
            for array in of.values() if isinstance(of, dict) else [of]:
                assert array.flags.writeable and array.dtype == np.float32
    np.testing.assert_equal(run(env), first)
    np.testing.assert_equal(run(eg.parallel_env(src, 5, observation=observation)), first)


def test_more_agents_change_what_others_do_and_hidden_ones_drive(src):
    scene = src.scenes[0]
    of = lambda **options: episode(eg.parallel_env(src, **options), options={"scene": scene})
    alone, idm, several = of(agents=1), of(agents=1, others="idm"), of(agents=8)
    assert set(several[0][0]) > {"agent_0"}
    for other in (idm, several):
        np.testing.assert_equal(other[0][0]["agent_0"], alone[0][0]["agent_0"])
        assert any(not np.array_equal(a[0]["agent_0"], b[0]["agent_0"]) for a, b in zip(other, alone) if "agent_0" in b[0])


def test_a_function_is_given_the_records_of_a_single_environment(src):
    kept = {"one": [], "env": []}
    keeps = lambda which: lambda record: kept[which].append(record) or 3.0 * record["reward"] - 1.0
    one, alike, ends = eg.AdversarialEnv(src, reward=keeps("one")), 0, set()
    env = eg.parallel_env(src, agents=1, reward=keeps("env"))
    for scene in src.scenes:
        for of in kept.values():
            of.clear()
        obs, _ = one.reset(options={"scene": scene})
        over, worth = False, []
        while not over:
            obs, reward, end, cut, _ = one.step(along_the_route(obs))
            worth.append(reward)
            over = end or cut
        told = episode(env, options={"scene": scene})
        rewards = [step[1]["agent_0"] for step in told[1:]]
        assert rewards == [3.0 * of["reward"] - 1.0 for of in kept["env"]]
        assert all(of["agent"] == "agent_0" and set(kept["one"][0]) <= set(of) for of in kept["env"])
        if rewards == worth:
            alike += 1
            for expected, found in zip(kept["one"], kept["env"]):
                assert found.pop("route_completion") == pytest.approx(expected.pop("route_completion"), abs=1e-6)
                assert {name: found[name] for name in expected} == expected
                ends.add(found["end"])
    assert alike >= 2 and len(ends) > 2, (alike, ends)
    several, seen = eg.parallel_env(src, agents=4, reward=keeps("env"), seed=5), kept["env"]
    seen.clear()
    told = episode(several)
    assert len({of["agent"] for of in seen}) > 1 and [of["reward"] * 3.0 - 1.0 for of in seen] == [x for step in told[1:] for x in step[1].values()]
    assert {of["track"] for of in seen} == {of["track"] for of in told[0][1].values()}


def test_a_function_that_breaks_names_the_agent(src):
    bad = {}
    env = eg.parallel_env(src, agents=2, reward=lambda record: bad.get(record["agent"], 0.0))
    for worth, error, said in [(math.nan, ValueError, "reward was nan in agent_1; expected"), (None, RuntimeError, "reward raised TypeError in agent_1")]:
        env.reset(seed=1)
        step = lambda: env.step({agent: np.float32([0.0, 0.5]) for agent in env.agents})
        bad["agent_1"] = worth
        with pytest.raises(error, match=said):
            step()
        bad.clear()
        with pytest.raises(RuntimeError, match=r"the step that it was asked of is lost; expected reset\(\)"):
            step()
    assert episode(env, seed=1)[1][1] == {"agent_0": 0.0, "agent_1": 0.0}


def worth(record):
    return record["progress_m"]


@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copied", "pickled"])
@pytest.mark.parametrize("others", ["recorded", "idm"])
def test_a_copy_goes_on_as_the_original(src, others, again):
    options = {"observation": eg.Observation(stack=3), "reward": worth, "out_of_bounds": "clip", "render_mode": "rgb_array", "width": 200}
    env = eg.parallel_env(src, 5, others, seed=2, **options)

    def go_on(env):
        told = []
        for step in range(150):
            if not env.agents:
                told.append(env.reset())
            actions = {agent: [0.01 * i, 0.1 * (step % 9)] for i, agent in enumerate(env.agents)}
            told += [env.step(actions), *([env.render()] if step % 50 == 0 else [])]
        return told, env.action_space("agent_1").sample()

    env.action_space("agent_1").seed(1)  # an unseeded space draws its seed when it is asked first
    fresh = again(env)
    np.testing.assert_equal(go_on(fresh), go_on(env))
    for _ in range(3):
        other = again(env)
        np.testing.assert_equal(other.render(), env.render())
        np.testing.assert_equal(go_on(other), go_on(env))


def test_numbers_and_stacks_are_each_agent_s(src):
    env = eg.parallel_env(src, 4, observation=eg.Observation(stack=3), actions=eg.Discrete(3, 3))
    plain = eg.parallel_env(src, 4)
    assert env.action_space("agent_0").n == 9 and env.observation_space("agent_3").shape == (3, 126)
    (seen, _), (expected, _) = env.reset(seed=4), plain.reset(seed=4)
    frames = {agent: [of] * 3 for agent, of in expected.items()}
    for step in range(40):
        for agent, of in seen.items():
            assert np.array_equal(of, frames[agent])
        if not env.agents:
            break
        number = {agent: (i + step) % 9 for i, agent in enumerate(env.agents)}
        seen, *told = env.step(number)
        values = {agent: np.float32([of % 3 - 1, of // 3 - 1]) for agent, of in number.items()}
        expected, *same = plain.step(values)
        assert told == same
        frames = {agent: [*frames[agent][1:], of] for agent, of in expected.items()}
    env.reset(seed=4)
    with pytest.raises(ValueError, match="agent_1: the action is 9; expected a number from 0 to 8"):
        env.step({agent: 9 * (agent == "agent_1") for agent in env.agents})


def test_a_picture_has_the_first_agent_in_the_middle(src):
    scene = next(scene for scene in src.scenes if len(eg.parallel_env(src, 4).reset(options={"scene": scene})[0]) > 2)
    env, one = (make(src, render_mode="rgb_array", width=300) for make in (eg.parallel_env, eg.AdversarialEnv))
    with pytest.raises(RuntimeError, match="before the first reset"):
        env.render()
    env.reset(options={"scene": scene}), one.reset(options={"scene": scene})
    first, alone = env.render(), one.render()
    assert first.shape == alone.shape and first.dtype == np.uint8
    # The same moment; the title says other words, and other agents are marked.
    same = (first == alone).all(-1).mean()
    assert 0.8 < same < 1.0, same
    seen, middles = {first.tobytes()}, set()
    while env.agents:
        env.step({agent: [0.2 * (agent == "agent_0"), 0.9] for agent in env.agents})
        middles.add(env._middle)
        seen.add(env.render().tobytes())
    assert len(seen) > 5 and len(middles) > 1, "who left is in the middle no more"
    assert env.render().tobytes() in seen


def test_bad_input_names_the_agent_and_leaves_the_environment_usable(src):
    env, good = eg.parallel_env(src, agents=3), np.float32([0.0, 0.5])
    with pytest.raises(RuntimeError, match="before the first reset"):
        env.step({"agent_0": good})
    env.reset(seed=1)
    assert env.agents == ["agent_0", "agent_1", "agent_2"]
    full = {agent: good for agent in env.agents}
    for actions, said in [
        ({"agent_0": good, "agent_2": good}, "no action of agent_1; expected one each of agent_0, agent_1, agent_2"),
        (full | {"car": good}, "an action of 'car', which is no agent; expected one each of agent_0"),
        (full | {"agent_1": np.float32([math.nan, 0])}, r"agent_1: action\[0\] is nan; expected a number from -1 to 1"),
        (full | {"agent_1": [0, 2]}, r"agent_1: action\[1\] is 2.0; expected a number"),
        (full | {"agent_2": np.zeros(3)}, r"agent_2: the action has the shape \(3,\); expected \(2,\)"),
        (full | {"agent_2": "left"}, "agent_2: the action is 'left'; expected two numbers"),
    ]:
        with pytest.raises(ValueError, match=said):
            env.step(actions)
    same = eg.parallel_env(src, agents=3)
    same.reset(seed=1)
    np.testing.assert_equal(env.step(full), same.step(full))
    while len(env.agents) == 3:
        env.step({agent: np.float32([0.0, 1.0]) for agent in env.agents})
    with pytest.raises(ValueError, match="has left the scene"):
        env.step(full)
    while env.agents:
        env.step({agent: good for agent in env.agents})
    with pytest.raises(RuntimeError, match=r"all agents have left; expected reset\(\)"):
        env.step({})
    with pytest.raises(ValueError, match="no scene 'nowhere'"):
        env.reset(options={"scene": "nowhere"})
    assert episode(env)
    clips = eg.parallel_env(src, agents=1, out_of_bounds="clip")
    clips.reset(seed=1), clips.step({"agent_0": [7.0, -3.0]})
    with pytest.raises(ValueError, match="nan"):
        clips.step({"agent_0": [math.nan, 0.0]})


def test_what_cannot_be_shared_is_refused(pools, tmp_path, monkeypatch):
    src = eg.Scenarios(pools[0], {"plain": None, "cat": "cat"}, {"plain": 0.5, "cat": 0.5}, held_out=pools[1])
    with pytest.raises(ValueError, match="program cat is in the mix; expected plain scenes alone: a program plans"):
        eg.parallel_env(src)
    plain = eg.Scenarios(pools[0], {"plain": None, "cat": "cat"}, {"plain": 1.0})
    staged = eg.Scenarios(eg.generate(tmp_path / "staged.pool", 0, 7, protocol="safebench"))
    for error, said, options in [
        (ValueError, "agents is 0; expected a number from 1", {"agents": 0}),
        (ValueError, 'others is "replay"; expected recorded, idm', {"others": "replay"}),
        (ValueError, "metadrive-2", {"observation": "metadrive-2"}),
        (ValueError, "reward: crash is .*expected a finite number|reward:", {"reward": eg.MetaDriveReward(crash=math.nan)}),
        (TypeError, "reward is a str; expected MetaDriveReward, SafeBenchReward or a function", {"reward": "speed"}),
        (ValueError, "render_mode is 'human'", {"render_mode": "human"}),
        (ValueError, "width is 7; expected 200 to 4000 pixels", {"width": 7}),
        (TypeError, "actions is 'left'; expected evodrive.gym.Discrete", {"actions": "left"}),
        (ValueError, "out_of_bounds is 'wrap'", {"out_of_bounds": "wrap"}),
        (TypeError, "held-out scenes are not trained in", {"scenarios": src.held_out}),
        (ValueError, "is staged for SafeBench's traffic families.*expected scenes of traffic", {"scenarios": staged}),
    ]:
        with pytest.raises(error, match=said):
            eg.parallel_env(**{"scenarios": plain, **options})
    eg.parallel_env(plain).reset()
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    monkeypatch.delitem(sys.modules, "evodrive.gym.parallel")
    with pytest.raises(ImportError, match="pip install pettingzoo"):
        eg.parallel_env(plain)
