"""How fast the environments are from Python, and others beside them where they are installed.

    python -c 'import evodrive.gym as eg; eg.generate("bench.pool", 200, seed=7)'
    python bridges/python/benches/env.py bench.pool

Each figure is the median of rounds that take turns, so that what else the machine does falls on all alike. Beside steps a second of
the clock stand steps a second of CPU time: those of a core that nobody else uses. `outside the engine` is the share of a step's time
that is Python's. The driver keeps to the route at a steady speed, as in `evodrive bench env`, so episodes last as a driver's do.
"""

import argparse
import json
import os
import statistics
import time

import numpy as np

import evodrive.gym as eg

ONE = np.float32


def along_the_route(obs, observation):
    if observation == "metadrive-1":
        steering, speed = obs[..., 4] * ONE(4.5) - obs[..., 3] * ONE(0.6), obs[..., 0] * ONE(20)
    else:
        steering, speed = obs[..., 1] * ONE(2.7) - obs[..., 0] * ONE(0.3), obs[..., 2]
    return np.clip(np.stack([steering, (ONE(8) - speed) * ONE(0.5)], -1), ONE(-1), ONE(1))


class Spent:
    """Time by the clock, and of the processor."""

    def __init__(self):
        self.wall = self.cpu = 0.0

    def begun(self):
        self.since = time.perf_counter(), time.process_time()
        return self

    def ended(self):
        self.wall += time.perf_counter() - self.since[0]
        self.cpu += time.process_time() - self.since[1]
        return self

    def without(self, other):
        return self.wall - other.wall, self.cpu - other.cpu


class Engine:
    """The compiled part, with the time that is spent in it."""

    def __init__(self, inner):
        self.inner, self.seconds = inner, 0.0

    def step(self):
        begun = time.perf_counter()
        done = self.inner.step()
        self.seconds += time.perf_counter() - begun
        return done

    def __getattr__(self, name):
        return getattr(self.inner, name)


class Ours:
    def __init__(self, src, observation, places, threads, steps):
        self.name = f"evodrive {observation}, {places} environments, {threads} thread{'s' * (threads > 1)}"
        self.observation, self.steps, self.places, self.threads = observation, steps, places, threads
        self.env = eg.VecEnv(src, places, threads, observation, autoreset="same_step", seed=0, copy=False)
        self.env._engine.native = Engine(self.env._engine.native)
        self.obs, _ = self.env.reset()

    def round(self):
        engine, policy = self.env._engine.native, Spent()
        engine.seconds = 0.0
        whole = Spent().begun()
        for _ in range(self.steps):
            policy.begun()
            actions = along_the_route(self.obs, self.observation)
            policy.ended()
            self.obs, *_ = self.env.step(actions)
        wall, cpu = whole.ended().without(policy)
        count = self.steps * self.places
        return {"steps_per_s": count / wall, "steps_per_cpu_s": count / cpu, "outside": 1.0 - engine.seconds / wall}


class Single:
    def __init__(self, src, observation, steps):
        self.name, self.observation, self.steps = f"evodrive {observation}, one plain environment", observation, steps
        self.env = eg.AdversarialEnv(src, observation, seed=0)
        self.obs, _ = self.env.reset()

    def round(self):
        policy, whole = Spent(), Spent().begun()
        for _ in range(self.steps):
            policy.begun()
            action = along_the_route(self.obs, self.observation)
            policy.ended()
            self.obs, _, ended, cut, _ = self.env.step(action)
            if ended or cut:
                self.obs, _ = self.env.reset()
        wall, cpu = whole.ended().without(policy)
        return {"steps_per_s": self.steps / wall, "steps_per_cpu_s": self.steps / cpu}


class Gymnasium:
    """Somebody else's environment, driven straight on."""

    def __init__(self, name, make, action, steps):
        self.name, self.env, self.action, self.steps = name, make(), action, steps
        self.env.reset(seed=0)

    def round(self):
        wall, cpu = time.perf_counter(), time.process_time()
        for _ in range(self.steps):
            _, _, ended, cut, _ = self.env.step(self.action)
            if ended or cut:
                self.env.reset()
        return {
            "steps_per_s": self.steps / (time.perf_counter() - wall),
            "steps_per_cpu_s": self.steps / (time.process_time() - cpu),
        }


def others(exported):
    """highway-env: 5 to 50 vehicles by IDM on a straight road, kinematics of five as the observation, 1 decision of 1 s in 15 steps of
    physics. MetaDrive's ScenarioEnv: the same scenes (`scenes export --format scenarionet`), Bullet physics, its own 2-D lidar."""
    try:
        import gymnasium
        import highway_env

        options = {"vehicles_count": 16, "action": {"type": "ContinuousAction"}, "policy_frequency": 10, "simulation_frequency": 10}
        make = lambda: gymnasium.make("highway-v0", config=options).unwrapped
        yield Gymnasium(f"highway-env {highway_env.__version__}, 16 vehicles", make, np.zeros(2, np.float32), 300)
    except ImportError:
        print("highway-env is not installed")
    try:
        if exported is None:
            raise ImportError
        from metadrive.envs.scenario_env import ScenarioEnv

        count = len([name for name in os.listdir(exported) if name.startswith("sd_") and name.endswith(".pkl")])
        options = {"data_directory": exported, "num_scenarios": count, "reactive_traffic": True, "log_level": 50}
        yield Gymnasium("MetaDrive 0.4.3 ScenarioEnv", lambda: ScenarioEnv(options), [0.0, 0.2], 300)
    except ImportError:
        print("MetaDrive is not installed, or --exported names no scenes")


def main():
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("pool")
    options.add_argument("--rounds", type=int, default=7)
    options.add_argument("--exported", help="folder of `evodrive scenes export --format scenarionet`, for MetaDrive")
    options.add_argument("--json", action="store_true")
    given = options.parse_args()
    src = eg.Scenarios(given.pool, {"plain": None, "cat": "cat"}, {"plain": 0.3, "cat": 0.7})
    cores = os.cpu_count() or 1
    runners = []
    for observation in ("metadrive-1", "safebench-1"):
        runners += [Ours(src, observation, 1024, threads, 40) for threads in sorted({1, min(2, cores)})]
        runners.append(Single(src, observation, 4000))
    runners += others(given.exported)
    told = {runner.name: [] for runner in runners}
    for _ in range(given.rounds):
        for runner in runners:
            told[runner.name].append(runner.round())
    medians = {name: {key: statistics.median(of[key] for of in rounds) for key in rounds[0]} for name, rounds in told.items()}
    if given.json:
        print(json.dumps({"rounds": given.rounds, "load": os.getloadavg()[0], "cores": cores, "medians": medians}, indent=1))
        return
    print(f"{cores} cores, load {os.getloadavg()[0]:.1f}, medians of {given.rounds} rounds")
    print(f"{'':58} {'steps/s':>10} {'steps/CPU s':>12} {'outside the engine':>20}")
    for name, of in medians.items():
        outside = f"{100 * of['outside']:.1f} %" if "outside" in of else ""
        print(f"{name:58} {of['steps_per_s']:>10,.0f} {of['steps_per_cpu_s']:>12,.0f} {outside:>20}")


if __name__ == "__main__":
    main()
