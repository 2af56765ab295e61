"""Train a driver, evolve adversaries against it, train it again: and does that help? From the same first half four drivers are trained on,
each for as many steps: in plain scenes, under the families' parents, under programs evolved against it, and in the scenes in which PDM
is hit. All are tested under all of these in held-out scenes, beside IDM, PDM and who stands still. The result is printed as it is.

    pip install ./bridges/python torch
    python -c 'import evodrive.gym as eg; eg.generate("open.pool", 400, seed=7); eg.generate("closed.pool", 150, seed=8)'
    python examples/loop.py open.pool closed.pool
"""

import argparse
import copy
import statistics
import sys
from pathlib import Path

import evodrive.gym as eg
from evodrive.runs import command

sys.path.insert(0, str(Path(__file__).parent / "train"))
import ppo

options = argparse.ArgumentParser()
options.add_argument("pool")
options.add_argument("held_out")
options.add_argument("--steps", type=int, default=2_000_000, help="of each half")
options.add_argument("--seeds", type=int, default=5)
options.add_argument("--envs", type=int, default=512)
options.add_argument("--families", nargs="+", default=["cat"])
options.add_argument("--out", type=Path, default=Path("loop"))
options.add_argument("--epochs", type=int, default=4, help="of evolution")
given = options.parse_args()
given.out.mkdir(parents=True, exist_ok=True)

# Student's t, two-sided, at 95 % shared among three comparisons, by seeds.
T = {2: 38.19, 3: 7.649, 4: 4.857, 5: 3.961, 6: 3.534, 7: 3.287, 8: 3.128, 9: 3.016, 10: 2.933}


def hard(pool, name):
    """The scenes of a pool in which a family's parent, planned around PDM, brings PDM to a contact."""
    kept = given.out / f"{name}.pool"
    if kept.exists():
        return kept
    ids, hit = eg.Scenarios(pool).scenes, set()
    for family in given.families:
        program = given.out / f"{family}.json"
        if not program.exists():
            command("program", "new", "--family", family, "--out", program)
        said = command("apply", program, "--scenes", pool, "--ego", "pdm", "--scenes-broken")
        hit |= {of["scene"] for of in said["broken"] if of["program"] != "-"}
    command("scenes", "filter", pool, *(f"--without={scene}" for scene in ids if scene not in hit), "--out", kept)
    print(f"{name}: PDM is hit in {len(hit)} of {len(ids)} scenes", flush=True)
    return kept


def train(src, seed, learner):
    env = eg.VecEnv(src, given.envs, threads=1, reward=ppo.REWARD, autoreset="same_step", seed=1000 * seed)
    env.policy = learner.policy
    return learner.learn(env, given.steps)


def figures(driver, tests):
    """Crash rate and route completion in each test. Drivers that do not learn are asked once where no program changes from seed to seed."""
    of = {}
    for name, (pool, programs) in tests.items():
        if (driver, name) not in known:
            figures = next(iter(eg.evaluate(driver, eg.Scenarios(pool, programs)).values()))
            known[driver, name] = figures["crash_rate"], figures["route_completion"]
        of[name] = known[driver, name]
        if name.endswith("evolved") or not isinstance(driver, str):
            del known[driver, name]
    return of


def mixed(programs, pool=given.pool, **around):
    share = 0.7 / len(programs)
    return eg.Scenarios(pool, {"plain": None, **programs}, {"plain": 0.3, **dict.fromkeys(programs, share)}, **around)


hard_open, hard_closed = hard(given.pool, "hard-open"), hard(given.held_out, "hard-closed")
plain = eg.Scenarios(given.pool)
around = {"plan_around": "policy", "replan_every": max(given.steps // 2, 1)}
rows, known = {}, {}
for seed in range(1, given.seeds + 1):
    first = train(plain, seed, ppo.Learner(seed))
    evolved = eg.evolve(first.policy(), plain, given.families, out=given.out / f"evolved-{seed}", epochs=given.epochs)
    programs = {f"{of.family} evolved": of for of in evolved}
    parents = {of.family: given.out / f"{of.family}-parent-{seed}.json" for of in evolved}
    for of in evolved:  # under the rules of the run
        name = f"{of.family}-policy/parent"
        command("program", "export", name, "--run", of.run, "--out", parents[of.family], "--overwrite")
    tests = {"plain": (given.held_out, None)}
    tests |= {name: (given.held_out, {name: of}) for name, of in {**parents, **programs}.items()}
    tests |= {f"{name}, PDM hit": (hard_closed, {name: of}) for name, of in parents.items()}
    arms = {
        "plain again": plain,
        "parents": mixed(parents, **around),
        "evolved": mixed(programs, **around),
        "PDM-hard": mixed(parents, hard_open, plan_around="pdm"),
    }
    drivers = {"first half": first.policy(), "IDM": "idm", "PDM": "pdm", "standing still": "standing"}
    for name, src in arms.items():
        drivers[name] = train(src, seed, copy.deepcopy(first)).policy()
        eg.save_policy(drivers[name], given.out / f"{name.replace(' ', '-')}-{seed}.safetensors")
    for name, driver in drivers.items():
        rows.setdefault(name, []).append(figures(driver, tests))
        print(f"seed {seed}  {name:14}", "  ".join(f"{of}: {c:.3f} {r:.3f}" for of, (c, r) in rows[name][-1].items()), flush=True)

print(f"\n{given.seeds} seeds, {given.steps} + {given.steps} steps, held-out scenes: crash rate, route completion (mean over seeds)")
print(" " * 14, "  ".join(f"{test:>18}" for test in rows["IDM"][0]))
for name, of_seeds in rows.items():
    cells = [[statistics.mean(of[test][k] for of in of_seeds) for k in (0, 1)] for test in of_seeds[0]]
    print(f"{name:14}", "  ".join(f"{crash:12.3f} {route:.3f}" for crash, route in cells))
crashes = lambda of: statistics.mean(crash for crash, _ in of.values())
for name in ("parents", "evolved", "PDM-hard") if given.seeds in T else ():
    gains = [crashes(before) - crashes(after) for before, after in zip(rows["plain again"], rows[name])]
    mean, half_width = statistics.mean(gains), T[given.seeds] * statistics.stdev(gains) / given.seeds**0.5
    verdict = "fewer crashes" if mean > half_width else "more crashes" if mean < -half_width else "no difference shown"
    print(f"{name} beside plain again: {verdict}, mean over the tests {mean:+.3f} +- {half_width:.3f} (95 % for the three together)")
