"""PufferLib's interface over the environments; skipped where PufferLib is not installed."""

import sys

import numpy as np
import pytest

import evodrive.gym as eg


def test_without_pufferlib_an_exception_says_what_brings_it(pools, monkeypatch):
    monkeypatch.setitem(sys.modules, "pufferlib", None)
    with pytest.raises(ImportError, match="pip install .* pufferlib==3.0.0"):
        eg.VecEnv(eg.Scenarios(pools[0]), 2).puffer()


@pytest.fixture
def pufferlib(monkeypatch, tmp_path):
    # It makes a link in the working directory when it is imported.
    monkeypatch.chdir(tmp_path)
    return pytest.importorskip("pufferlib", reason="PufferLib is not installed (bridges/python/README.md, Other libraries)")


def law(obs):
    one = np.float32
    steering, speed = obs[:, 4] * one(4.5) - obs[:, 3] * one(0.6), obs[:, 0] * one(20)
    return np.clip(np.stack([steering, (one(8) - speed) * one(0.5)], 1), one(-1), one(1))


def test_a_rollout_is_that_of_the_vector_in_the_buffers_that_were_given(pools, pufferlib):
    import pufferlib.vector

    src = eg.Scenarios(pools[0], {"plain": None, "cat": "cat"})
    reward = eg.MetaDriveReward(crash=30.0)
    plain = eg.VecEnv(src, 6, reward=reward, autoreset="same_step", seed=3, preventable=True)
    made = []

    def create(buf=None, seed=None):
        made.append(eg.VecEnv(src, 3, reward=reward, preventable=True).puffer(buf, seed))
        return made[-1]

    # Two native environments of three agents each, side by side in one set of buffers.
    vec = pufferlib.vector.make(create, backend="Serial", num_envs=2, seed=0)
    assert vec.num_agents == 6 and vec.single_observation_space == plain.single_observation_space
    # The seeds 1 and 2 of the two are 3 .. 5 and 6 .. 8 of their agents.
    obs, _ = vec.reset(seed=1)
    expected, _ = plain.reset()
    assert np.array_equal(obs, expected)
    ended = 0
    for _ in range(250):
        actions = law(expected)
        obs, rewards, terminals, truncations, infos = vec.step(actions)
        expected, worth, terminated, truncated, info = plain.step(actions)
        assert obs is vec.observations and all(of.observations.base is not None for of in made[-2:])
        assert np.array_equal(obs, expected) and np.array_equal(rewards, worth.astype(np.float32))
        assert np.array_equal(terminals, terminated) and np.array_equal(truncations, truncated)
        over = info.get("_final_info", np.zeros(6, bool))
        assert len(infos) == over.sum()
        for told, i in zip(infos, np.flatnonzero(over)):
            assert told == {name: of[i].item() for name, of in info["final_info"].items() if not name.startswith("_")}
            assert told["episode_length"] > 0 and 0.0 <= told["route_completion"] <= 1.0
        ended += over.sum()
    assert ended > 6
    vec.close()


def test_an_environment_alone_is_native(pools, pufferlib):
    import pufferlib.vector

    src = eg.Scenarios(pools[0])
    vec = pufferlib.vector.make(lambda: eg.VecEnv(src, 4, observation="safebench-1", seed=1).puffer())
    obs, infos = vec.reset(seed=7)
    first = obs.copy()
    assert obs.shape == (4, 4) and infos == []
    vec.send(np.zeros((4, 2), np.float32))
    obs, rewards, terminals, truncations, infos, ids, masks = vec.recv()
    assert not np.array_equal(obs, first) and masks.all() and list(ids) == [0, 1, 2, 3]
    assert rewards.dtype == np.float32 and terminals.dtype == bool
    again = eg.VecEnv(src, 4, observation="safebench-1").puffer(seed=7)
    assert np.array_equal(again.reset()[0], first)


def test_what_does_not_fit_is_refused(pools, pufferlib):
    with pytest.raises(ValueError, match="PufferLib"):
        eg.VecEnv(eg.Scenarios(pools[0]), 2, observation="arrays-1").puffer()
