"""The baseline driver: PPO in plain torch, in plain scenes, compared with IDM by route completion and crash rate.

    pip install ./bridges/python torch
    python examples/train/baseline.py --seed 1

Scenes are generated: many to train in, some to choose by (validation), some that are driven once, at the end (test). Weights go to `--out`.
`--steps 200000 --scenes 100` is a short form.
"""

import argparse
import sys
from pathlib import Path

import evodrive.gym as eg

sys.path.insert(0, str(Path(__file__).parent))
import ppo

options = argparse.ArgumentParser()
options.add_argument("--steps", type=int, default=5_000_000)
options.add_argument("--seed", type=int, default=1)
options.add_argument("--envs", type=int, default=512)
options.add_argument("--scenes", type=int, default=4000, help="to train in")
options.add_argument("--held-out", type=int, nargs=2, default=(300, 600), help="scenes to choose by, and to test in")
options.add_argument("--folder", type=Path, default=Path("baseline"), help="where the pools of scenes go")
options.add_argument("--out", type=Path, default=Path("baseline.safetensors"))
given = options.parse_args()

given.folder.mkdir(parents=True, exist_ok=True)
pools = {}
for name, count, seed in zip(("train", "valid", "test"), (given.scenes, *given.held_out), (101, 202, 303)):
    pools[name] = given.folder / f"{name}-{count}.pool"
    if not pools[name].exists():
        eg.generate(pools[name], count, seed)
src = eg.Scenarios(pools["train"], held_out=pools["valid"])
env = eg.VecEnv(src, given.envs, threads=1, reward=ppo.REWARD, autoreset="same_step", seed=1000 * given.seed)
learner = ppo.Learner(given.seed).learn(env, given.steps, note=lambda line: print(line, flush=True))
eg.save_policy(learner.policy(), given.out)
for name in ("valid", "test"):
    scenes = eg.Scenarios(pools[name])
    for driver in (given.out, "idm", "standing"):
        of = eg.evaluate(driver, scenes)["plain"]
        print(f"{name:5} {driver!s:24} crash {of['crash_rate']:.3f}  completion {of['route_completion']:.3f}", flush=True)
