"""Train a driver, evolve adversaries against it, train it again: and does that help? Beside each seed's driver stands one that was
trained in plain scenes for as many steps, from the same first half. The result is printed as it is.

    pip install ./bridges/python stable-baselines3
    python -c 'import evodrive.gym as eg; eg.generate("open.pool", 400, seed=7); eg.generate("closed.pool", 100, seed=8)'
    python examples/loop.py open.pool closed.pool --steps 2000000
"""

import argparse
import statistics
from pathlib import Path

import torch
from stable_baselines3 import PPO

import evodrive.gym as eg

options = argparse.ArgumentParser()
options.add_argument("pool")
options.add_argument("held_out")
options.add_argument("--steps", type=int, default=2_000_000, help="of each half")
options.add_argument("--seeds", type=int, default=3)
options.add_argument("--envs", type=int, default=128)
options.add_argument("--families", nargs="+", default=["cat"])
options.add_argument("--out", type=Path, default=Path("loop"))
options.add_argument("--epochs", type=int, default=4, help="of evolution")
given = options.parse_args()
torch.set_num_threads(1)
given.out.mkdir(parents=True, exist_ok=True)


def train(src, seed, begun=None):
    """Half of a training, from the first step or on from a saved model."""
    env = eg.VecEnv(src, given.envs, reward=eg.MetaDriveReward(crash=30.0), seed=1000 * seed)
    shape = {"net_arch": [128, 128], "log_std_init": -0.7}
    if begun is None:
        model = PPO("MlpPolicy", eg.sb3(env), n_steps=64, batch_size=1024, policy_kwargs=shape, device="cpu", seed=seed)
    else:
        model = PPO.load(begun, env=eg.sb3(env), device="cpu")
    env.policy = model
    return model.learn(given.steps)


def figures(driver, src):
    """Crash rate and route completion by program, in the held-out scenes."""
    return {name: (of["crash_rate"], of["route_completion"]) for name, of in eg.evaluate(driver, src.held_out).items()}


rows, gains = {}, []
plain = eg.Scenarios(given.pool, held_out=given.held_out)
for seed in range(1, given.seeds + 1):
    first = train(plain, seed)
    half = given.out / f"half-{seed}.zip"
    first.save(half)
    evolved = eg.evolve(first, plain, given.families, out=given.out / f"evolved-{seed}", epochs=given.epochs)
    programs = {"plain": None, **{of.family: of for of in evolved}}
    mix = {"plain": 0.3, **{of.family: 0.7 / len(evolved) for of in evolved}}
    every = max(given.steps // 5, 1)
    adversarial = eg.Scenarios(given.pool, programs, mix, "policy", every, held_out=given.held_out)
    both = {"plain again": train(plain, seed, half), "adversaries": train(adversarial, seed, half)}
    for name, driver in {"first half": first, **both, "IDM": "idm", "standing still": "standing"}.items():
        rows.setdefault(name, []).append(figures(driver, adversarial))
    of = {name: eg.save_policy(model, given.out / f"{name.replace(' ', '-')}-{seed}.safetensors") for name, model in both.items()}
    hardest = [max(crash for crash, _ in rows[name][-1].values()) for name in of]
    gains.append(hardest[0] - hardest[1])
    print(f"seed {seed}: hardest program's crash rate {hardest[0]:.3f} after plain, {hardest[1]:.3f} after adversarial training", flush=True)

print(f"\n{given.seeds} seeds, {given.steps} + {given.steps} steps, held-out scenes: crash rate, route completion (mean over seeds)")
for name, of_seeds in rows.items():
    cells = [f"{p:>10} " + " ".join(f"{statistics.mean(of[p][k] for of in of_seeds):.3f}" for k in (0, 1)) for p in of_seeds[0]]
    print(f"{name:16}", "  ".join(cells))
if given.seeds > 1:
    t = {2: 12.706, 3: 4.303, 4: 3.182, 5: 2.776}.get(given.seeds, 2.571)
    mean, half_width = statistics.mean(gains), t * statistics.stdev(gains) / given.seeds**0.5
    verdict = "fewer crashes" if mean > half_width else "more crashes" if mean < -half_width else "no difference shown"
    print(f"verdict: {verdict} under the hardest program: {mean:+.3f} +- {half_width:.3f} (95 %, Student's t over seeds)")
