"""PPO in plain torch over a `VecEnv` of "metadrive-1": what `baseline.py` and `../loop.py` train with. One thread; a seed gives the
same weights again on the same machine with the same torch."""

import copy
import time

import torch
from torch import nn

import evodrive.gym as eg

torch.set_num_threads(1)
LONG, EPOCHS, BATCH, GAMMA, LAMBDA, CLIP, RATE = 64, 3, 4096, 0.99, 0.95, 0.2, 1e-3
# Contact and leaving the road end the episode. Both cost much, and the same: with the road cheaper drivers left it before a contact.
REWARD, SCALE = eg.MetaDriveReward(crash=60.0, out_of_road=60.0, success=20.0), 20.0  # the critic's numbers are of size 1


def net(outputs, gain):
    layers = [nn.Linear(126, 128), nn.ReLU(), nn.Linear(128, 128), nn.ReLU(), nn.Linear(128, outputs)]
    for layer in layers[::2]:
        nn.init.orthogonal_(layer.weight, gain if layer is layers[-1] else 2**0.5)
        nn.init.zeros_(layer.bias)
    return nn.Sequential(*layers)


class Norm:
    """Mean and deviation of what was observed so far. They go into the first layer of what is saved."""

    def __init__(self):
        self.count, self.mean, self.var, self.deviation = 0, torch.zeros(126), torch.ones(126), torch.ones(126)

    def __call__(self, obs):
        return (obs - self.mean) / self.deviation

    def learn(self, obs):
        n, mean, var = len(obs), obs.mean(0), obs.var(0)
        share = n / (self.count + n)
        spread = self.var * (1 - share) + var * share + (mean - self.mean) ** 2 * share * (1 - share)
        self.var, self.mean, self.count = spread if self.count else var, self.mean + (mean - self.mean) * share, self.count + n
        self.deviation = self.var.sqrt().clamp(min=0.05)


class Learner:
    """An actor and its critic. A deep copy learns on from where the original stands."""

    def __init__(self, seed):
        torch.manual_seed(seed)
        self.actor, self.critic, self.norm = net(2, 0.01), net(1, 1.0), Norm()
        self.log_std = nn.Parameter(torch.tensor([-1.5, -0.7]))  # steering is finer than the pedal

    def policy(self):
        """The actor as `save_policy` takes it, with the normalisation in its first layer."""
        actor = copy.deepcopy(self.actor)
        actor[0].weight.data /= self.norm.deviation
        actor[0].bias.data -= actor[0].weight.data @ self.norm.mean
        return actor

    def learn(self, env, steps, note=lambda line: None):
        """Trains for so many steps of the environment; the rate of learning falls to nearly nothing over them."""
        actor, critic, norm, log_std = self.actor, self.critic, self.norm, self.log_std
        params = [*actor.parameters(), *critic.parameters(), log_std]
        adam = torch.optim.Adam(params, RATE, eps=1e-5)
        law = lambda obs: torch.distributions.Normal(actor(obs), log_std.exp(), validate_args=False)
        value = lambda obs: critic(obs)[:, 0]
        raw, rounds, began = torch.from_numpy(env.reset()[0]), max(steps // (env.num_envs * LONG), 1), time.time()
        for at in range(rounds):
            adam.param_groups[0]["lr"] = RATE * max(1 - at / rounds, 0.02)
            raws, seen, done, chance, got, over, ends = [], [], [], [], [], [], []
            with torch.no_grad():
                for _ in range(LONG):
                    raws.append(raw), seen.append(norm(raw)), done.append(law(seen[-1]).sample())
                    chance.append(law(seen[-1]).log_prob(done[-1]).sum(1))
                    after, reward, ended, cut, info = env.step(done[-1].clamp(-1, 1).numpy())
                    got.append(torch.from_numpy(reward).float() / SCALE), over.append(torch.from_numpy(ended | cut).float())
                    if cut.any():  # a time limit is no end: what would have come is counted in
                        got[-1] += torch.from_numpy(cut) * GAMMA * value(norm(torch.from_numpy(info["final_obs"])))
                    if "final_info" in info:
                        ends += info["final_info"]["end"][info["_final_info"]].tolist()
                    raw = torch.from_numpy(after)
                worth = [value(obs) for obs in [*seen, norm(raw)]]
                gain, gains = torch.zeros(env.num_envs), []
                for t in reversed(range(LONG)):
                    gain = got[t] + GAMMA * (1 - over[t]) * (worth[t + 1] + LAMBDA * gain) - worth[t]
                    gains.insert(0, gain)
                flat = [torch.cat(of) for of in (seen, done, chance, gains)]
                flat += [flat[3] + torch.cat(worth[:-1])]
                flat[3] = (flat[3] - flat[3].mean()) / (flat[3].std() + 1e-8)
            for _ in range(EPOCHS):
                for part in torch.randperm(len(flat[0])).split(BATCH):
                    obs, action, before, gain, back = (of[part] for of in flat)
                    ratio = (law(obs).log_prob(action).sum(1) - before).exp()
                    loss = 0.5 * (value(obs) - back).pow(2).mean() - torch.min(ratio * gain, ratio.clamp(1 - CLIP, 1 + CLIP) * gain).mean()
                    adam.zero_grad(), loss.backward()
                    nn.utils.clip_grad_norm_(params, 0.5)
                    adam.step()
            norm.learn(torch.cat(raws))
            if at % 20 == 19:
                ended = [f"{name} {ends.count(place) / max(len(ends), 1):.3f}" for place, name in enumerate(eg.ENDS)]
                note(f"{env.steps:9} steps, {time.time() - began:5.0f} s: {', '.join(ended)}")
        return self
