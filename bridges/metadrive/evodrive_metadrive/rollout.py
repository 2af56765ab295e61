"""One rollout: from a request to an answer."""

import math
from typing import Any

import numpy as np
from metadrive.engine.engine_utils import close_engine
from metadrive.manager.scenario_traffic_manager import ScenarioTrafficManager

from . import description, world
from .request import Request

# MetaDrive computes in single precision around the ego's start; a road user this near to its recording at every step follows
# it, and is not told. Metres and radians.
SAME_M, SAME_RAD = 0.005, 0.005
DECIMALS = 6


def pose(vehicle: Any, origin: np.ndarray) -> list[float]:
    """[x m, y m, heading rad, vx m/s, vy m/s] in the scene's coordinates, to a micrometre."""
    (x, y), (vx, vy) = vehicle.position, vehicle.velocity
    row = [float(x) + origin[0], float(y) + origin[1], float(vehicle.heading_theta), float(vx), float(vy)]
    if not all(math.isfinite(value) for value in row):
        raise ArithmeticError(f"MetaDrive gave a pose that is not finite: {row}")
    # Adding 0.0 makes a negative zero a positive one.
    return [round(value, DECIMALS) + 0.0 for value in row]


def play(request: Request) -> dict[str, Any]:
    """Plays a request in an environment of its own."""
    try:
        return _play(world.environment(request), request)
    finally:
        # Also where the environment could not be made: MetaDrive allows one engine in a process.
        close_engine()


def _play(env, request: Request) -> dict[str, Any]:
    scenario = description.of(request)
    if request.options.traffic_boxes == "recorded":
        world.own_boxes(scenario)
    env.set_scenario(scenario)
    # The seed is the scenario's index; no policy that is used here draws from it.
    env.reset(seed=0)
    origin = description.origin(request)
    manager: ScenarioTrafficManager = env.engine.traffic_manager

    def moment() -> tuple[list[float], dict[str, list[float]]]:
        objects = manager.spawned_objects
        others = {name: pose(objects[i], origin) for name, i in manager._scenario_id_to_obj_id.items()}
        return pose(env.agent, origin), others

    contacts = world.Contacts(env, moment)
    rows = [moment()]
    end, contact = "horizon", None
    for k in range(_last_step(request)):
        contacts.begin_step()
        _, _, ended, _, info = env.step([0.0, 0.0])
        if contacts.first is None and env.agent.crash_vehicle | env.agent.crash_human | env.agent.crash_object:
            contacts.first = _late_contact(env, contacts, moment)
        if contacts.first is not None:
            substep, name, row, boxes = contacts.first
            rows.append(row)
            end, contact = "contact", {"with": _who(name), "step": k, "substep": substep, "boxes": boxes}
            break
        rows.append(moment())
        if info["arrive_dest"] or info["out_of_road"]:
            end = "arrived" if info["arrive_dest"] else "off_road"
            break
    return {"end": end, "contact": contact, "ego": [ego for ego, _ in rows], "road_users": _told(request, rows, contact)}


def _last_step(request: Request) -> int:
    """The decision steps there are: a replayed ego ends with its recording."""
    if request.ego != "replay":
        return request.steps
    recorded = request.scene["ego"]["track"]["samples"][request.first_step :]
    present = next((k for k, sample in enumerate(recorded) if sample is None), len(recorded))
    return min(request.steps, present - 1)


def _late_contact(env, contacts, moment):
    """A contact that MetaDrive finds by its second test, after the step: with the nearest road user, at the end of the step."""
    nodes = env.engine.physics_world.dynamic_world.contactTest(env.agent.chassis.node(), True)
    contacts.touched = []
    for found in nodes.getContacts():
        contacts._note(found.getNode0(), found.getNode1())
    if not contacts.touched:
        return None
    name = min(contacts.touched)
    return 5, name, moment(), contacts.boxes(name)


def _who(name: str) -> dict[str, int]:
    kind, index = name.split("-")
    return {kind: int(index)}


def _told(request: Request, rows: list, contact: dict | None) -> list[dict[str, Any]]:
    """Commanded road users, then everyone who does not follow their recording, in the order of the scene."""
    told = []
    for adversary in request.adversaries:
        name = description.track_name(adversary.who)
        told.append({"who": adversary.who, "from_step": 0, "poses": [others.get(name) for _, others in rows]})
    commanded = {description.track_name(adversary.who) for adversary in request.adversaries}
    whole = len(rows) - (1 if contact is not None else 0)
    for index, track in enumerate(request.scene["tracks"]):
        name = f"track-{index}"
        if name in commanded:
            continue
        recorded = description.cut(track["samples"], request, request.steps)
        poses = [others.get(name) for _, others in rows]
        strays = (k for k in range(whole) if not _same(poses[k], recorded[k]))
        if (first := next(strays, None)) is not None:
            told.append({"who": {"track": index}, "from_step": first, "poses": poses[first:]})
    return told


def _same(told: list[float] | None, recorded: dict[str, Any] | None) -> bool:
    if told is None or recorded is None:
        return told is None and recorded is None
    apart = math.dist(told[:2], recorded["position"])
    turn = math.remainder(told[2] - recorded["heading_rad"], 2.0 * math.pi)
    return apart <= SAME_M and abs(turn) <= SAME_RAD
