"""Loads exported folders as data sets of MetaDrive, compares their summaries with MetaDrive's own, rolls each scene out with the
ego on its log, which must be where the log says at every step, and sorts the scenes into a curriculum of two levels."""

import math
import os
import sys

from metadrive.envs.scenario_env import ScenarioEnv
from metadrive.policy.replay_policy import ReplayEgoCarPolicy
from metadrive.scenario.scenario_description import ScenarioDescription
from metadrive.scenario.utils import read_dataset_summary, read_scenario_data

# MetaDrive simulates in single precision.
SAME_M = 0.01


def plain(value):
    """Sets as sorted lists, whole structures without heights: a scene is flat."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items() if key != "map_height_diff"}
    if isinstance(value, set):
        return sorted(value)
    return round(value, 6) if isinstance(value, float) else value


def check_summary(folder, file, entry):
    path = os.path.join(folder, file)
    ScenarioDescription.sanity_check(read_scenario_data(path), valid_check=True)
    theirs = ScenarioDescription.update_summaries(read_scenario_data(path))["metadata"]
    for key in ("number_summary", "object_summary"):
        if plain(theirs[key]) != plain(entry[key]):
            raise ValueError(f"{key} is {entry[key]}, MetaDrive counts {theirs[key]}")
        own = read_scenario_data(path)["metadata"].get(key)
        if own is None or plain(own) != plain(entry[key]):
            raise ValueError(f"{key} of the pickle itself is {own}, the list has {entry[key]}")


def roll_out(env, place):
    """Steps until MetaDrive ends the episode, and the ego's largest distance from its log, metres."""
    env.reset(seed=place)
    scenario = env.engine.data_manager.current_scenario
    log = scenario["tracks"][scenario["metadata"]["sdc_id"]]["state"]
    step, worst = 0, 0.0
    while True:
        _, _, ended, cut, _ = env.step([0.0, 0.0])
        step += 1
        if step < scenario["length"] and log["valid"][step]:
            worst = max(worst, math.dist(env.agent.position, log["position"][step, :2]))
        if ended or cut:
            return step, worst


def made(folder, **options):
    return ScenarioEnv(
        dict(
            use_render=False,
            log_level=50,
            data_directory=folder,
            agent_policy=ReplayEgoCarPolicy,
            horizon=1200,
            **options,
        )
    )


def check(folder):
    summary, files, mapping = read_dataset_summary(folder)
    if not all(os.path.exists(os.path.join(folder, name)) for name in ("dataset_summary.pkl", "dataset_mapping.pkl")):
        raise ValueError(f"{folder} lacks the files of a data set")
    for file in files:
        check_summary(folder, os.path.join(mapping[file], file), summary[file])
    env = made(folder, num_scenarios=len(files))
    failed = 0
    for place, file in enumerate(files):
        try:
            steps, worst = roll_out(env, place)
            if worst > SAME_M:
                raise ValueError(f"the ego is up to {worst:.3f} m beside its log")
            print(f"{os.path.basename(folder)}/{file}: {steps} steps", flush=True)
        except Exception as error:
            failed += 1
            print(f"{os.path.basename(folder)}/{file}: {type(error).__name__}: {error}", flush=True)
    env.close()
    if len(files) > 1:
        env = made(folder, num_scenarios=len(files) // 2 * 2, curriculum_level=2, sequential_seed=True)
        env.reset()
        env.close()
    return len(files), failed


counts = [check(folder) for folder in sys.argv[1:]]
files, failed = (sum(column) for column in zip(*counts))
print(f"MetaDrive: {files} scenes of {len(counts)} folders loaded and rolled out, {failed} failed")
sys.exit(0 if files and not failed else 1)
