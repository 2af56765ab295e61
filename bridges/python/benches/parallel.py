"""Agent steps a second of `evodrive.gym.parallel_env`, observations, rewards and resets included: one thread, generated scenes.

    python bridges/python/benches/parallel.py --agents 8 --scenes 40
"""

import argparse
import statistics
import tempfile
import time

import numpy as np

import evodrive.gym as eg

given = argparse.ArgumentParser(description=__doc__)
given.add_argument("--agents", type=int, default=8)
given.add_argument("--scenes", type=int, default=40)
given.add_argument("--rounds", type=int, default=5)
given = given.parse_args()
with tempfile.TemporaryDirectory() as folder:
    src = eg.Scenarios(eg.generate(f"{folder}/bench.pool", given.scenes, seed=7))
for others in ("recorded", "idm"):
    env, found = eg.parallel_env(src, given.agents, others), []
    for _ in range(given.rounds):
        steps, resets, policy, begun, used = 0, 0.0, np.zeros(2), time.perf_counter(), time.process_time()
        for scene in src.scenes:
            since = time.process_time()
            obs, _ = env.reset(options={"scene": scene})
            resets += time.process_time() - since
            while env.agents:
                since = time.perf_counter(), time.process_time()
                sheet = np.stack([obs[agent] for agent in env.agents])
                pedal = (np.float32(8) - sheet[:, 0] * np.float32(20)) * np.float32(0.5)
                taken = np.clip(np.stack([sheet[:, 4] * np.float32(4.5) - sheet[:, 3] * np.float32(0.6), pedal], 1), -1, 1)
                actions = dict(zip(env.agents, taken))
                policy += time.perf_counter() - since[0], time.process_time() - since[1]
                steps += len(actions)
                obs, *_ = env.step(actions)
        wall, cpu = time.perf_counter() - begun - policy[0], time.process_time() - used - policy[1]
        found.append((steps / wall, steps / cpu, resets / cpu))
    by_clock, by_processor, share = (statistics.median(of) for of in zip(*found))
    print(f"others={others}: {by_clock:.0f} agent steps/s, {by_processor:.0f} a second of processor time, {share:.0%} of it in resets")
