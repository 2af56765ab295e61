"""PPO of Stable-Baselines3 in plain scenes and under CAT's published parent, planned again around the policy.

    pip install ./bridges/python stable-baselines3
    python -c 'import evodrive.gym as eg; eg.generate("open.pool", 400, seed=7); eg.generate("closed.pool", 100, seed=8)'
    python examples/train/sb3_ppo.py open.pool closed.pool --steps 2000000
"""

import argparse

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

import evodrive.gym as eg

options = argparse.ArgumentParser()
options.add_argument("pool")
options.add_argument("held_out")
options.add_argument("--steps", type=int, default=2_000_000)
options.add_argument("--envs", type=int, default=256)
options.add_argument("--program", default="cat", help="a program file, or the name of a family")
given = options.parse_args()

src = eg.Scenarios(
    given.pool,
    programs={"plain": None, "adversary": given.program},
    mix={"plain": 0.3, "adversary": 0.7},
    plan_around="policy",
    replan_every=max(given.steps // 10, 1),
    held_out=given.held_out,
)
env = eg.VecEnv(src, given.envs, reward=eg.MetaDriveReward(crash=30.0), seed=1)
torch.set_num_threads(1)
model = PPO(
    "MlpPolicy",
    VecMonitor(eg.sb3(env)),
    n_steps=64,
    batch_size=1024,
    learning_rate=3e-4,
    gamma=0.99,
    policy_kwargs={"net_arch": [128, 128], "log_std_init": -0.7},
    device="cpu",
    seed=1,
    verbose=0,
)
env.policy = model
model.learn(given.steps)
eg.save_policy(model, "sb3_ppo.safetensors")
for driver in ("sb3_ppo.safetensors", "idm", "standing"):
    for program, of in eg.evaluate(driver, src.held_out).items():
        print(f"{driver:24} {program:10} crash {of['crash_rate']:.3f}  completion {of['route_completion']:.3f}")
