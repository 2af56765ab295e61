"""PPO in plain torch: the whole loop, over one array a step. Usage as of sb3_ppo.py beside it."""

import argparse

import torch
from torch import nn

import evodrive.gym as eg

options = argparse.ArgumentParser()
options.add_argument("pool")
options.add_argument("held_out")
options.add_argument("--steps", type=int, default=2_000_000)
options.add_argument("--envs", type=int, default=256)
given = options.parse_args()
torch.manual_seed(1)
torch.set_num_threads(1)
src = eg.Scenarios(given.pool, {"plain": None, "adversary": "cat"}, {"plain": 0.3, "adversary": 0.7}, held_out=given.held_out)
env, long = eg.VecEnv(src, given.envs, reward=eg.MetaDriveReward(crash=30.0), autoreset="same_step", seed=1), 64
net = lambda out: nn.Sequential(nn.Linear(126, 128), nn.Tanh(), nn.Linear(128, 128), nn.Tanh(), nn.Linear(128, out))
actor, critic, log_std = net(2), net(1), nn.Parameter(torch.full((2,), -0.7))
nn.init.zeros_(actor[-1].weight)
adam = torch.optim.Adam([*actor.parameters(), *critic.parameters(), log_std], 3e-4)
law = lambda obs: torch.distributions.Normal(actor(obs), log_std.exp())
obs = torch.from_numpy(env.reset()[0].copy())
for _ in range(max(given.steps // (given.envs * long), 1)):
    seen, done, chance, got, over, worth = [], [], [], [], [], []
    for _ in range(long):
        with torch.no_grad():
            action = law(obs).sample()
            seen.append(obs), done.append(action), chance.append(law(obs).log_prob(action).sum(1)), worth.append(critic(obs)[:, 0])
            after, reward, ended, cut, info = env.step(action.clamp(-1, 1).numpy())
            reward = torch.from_numpy(reward).float() / 10
            if cut.any():  # a time limit is no end: what would have come is counted in
                last = torch.from_numpy(info["final_obs"].copy())
                reward += torch.from_numpy(cut) * 0.99 * critic(last)[:, 0]
            got.append(reward), over.append(torch.from_numpy(ended | cut).float())
            obs = torch.from_numpy(after.copy())
    with torch.no_grad():
        gain, gains, next_worth = torch.zeros(given.envs), [], critic(obs)[:, 0]
        for t in reversed(range(long)):
            gain = got[t] + 0.99 * next_worth * (1 - over[t]) - worth[t] + 0.99 * 0.95 * (1 - over[t]) * gain
            gains.insert(0, gain)
            next_worth = worth[t]
    flat = [torch.cat(of) for of in (seen, done, chance, gains, worth)]
    for _ in range(5):
        for part in torch.randperm(len(flat[0])).split(1024):
            o, a, before, gain, old = (of[part] for of in flat)
            ratio = (law(o).log_prob(a).sum(1) - before).exp()
            norm = (gain - gain.mean()) / (gain.std() + 1e-8)
            loss = -torch.min(ratio * norm, ratio.clamp(0.8, 1.2) * norm).mean() + 0.5 * (critic(o)[:, 0] - gain - old).pow(2).mean()
            adam.zero_grad(), loss.backward()
            nn.utils.clip_grad_norm_([*actor.parameters(), *critic.parameters(), log_std], 0.5)
            adam.step()
eg.save_policy(actor, "torch_ppo.safetensors")
for program, of in eg.evaluate("torch_ppo.safetensors", src.held_out).items():
    print(f"{program:10} crash {of['crash_rate']:.3f}  completion {of['route_completion']:.3f}")
