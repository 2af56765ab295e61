"""Plays the first moment of every request of a file with `traffic_boxes = "recorded"` and compares the boxes that MetaDrive
simulates with the scene's. Vehicles that appear later get theirs in the same way.

    python bridges/metadrive/check_boxes.py REQUESTS
"""

import json
import sys

from metadrive.engine.engine_utils import close_engine

from evodrive_metadrive import description, world
from evodrive_metadrive.request import read


def compared(line):
    """How many vehicles there are, and the largest difference of a side, metres."""
    line["options"] = {**line["options"], "traffic_boxes": "recorded"}
    request = read(line)
    tracks = request.scene["tracks"]
    scenario = description.of(request)
    world.own_boxes(scenario)
    env = world.environment(request)
    try:
        env.set_scenario(scenario)
        env.reset(seed=0)
        manager = env.engine.traffic_manager
        sides = []
        for name, known in manager._scenario_id_to_obj_id.items():
            kind, _, index = name.partition("-")
            if kind == "track" and tracks[int(index)]["kind"] in ("vehicle", "static"):
                vehicle, track = manager.spawned_objects[known], tracks[int(index)]
                sides += [abs(vehicle.LENGTH - track["length_m"]), abs(vehicle.WIDTH - track["width_m"])]
        return len(sides) // 2, max(sides, default=0.0)
    finally:
        env.close()
        close_engine()


def main():
    vehicles, worst = 0, 0.0
    for text in open(sys.argv[1], encoding="utf-8"):
        count, difference = compared(json.loads(text))
        vehicles, worst = vehicles + count, max(worst, difference)
    print(f"{vehicles} vehicles, sides differ by at most {worst:.3f} m")
    return 0 if vehicles and worst < 1e-6 else 1


if __name__ == "__main__":
    sys.exit(main())
