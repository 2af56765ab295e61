"""Reads every CommonRoad file below a folder with commonroad-io: whole scenario, one planning problem, all obstacles."""

import logging
import pathlib
import sys
from xml.etree import ElementTree

from commonroad.common.file_reader import CommonRoadFileReader

logging.disable(logging.WARNING)
files = sorted(pathlib.Path(sys.argv[1]).rglob("*.xml"))
failed = 0
for file in files:
    root = ElementTree.parse(file).getroot()
    written = [len(root.findall(kind)) for kind in ("lanelet", "dynamicObstacle", "staticObstacle", "trafficSign", "trafficLight")]
    try:
        scenario, problems = CommonRoadFileReader(str(file)).open()
        network = scenario.lanelet_network
        read = [
            len(found)
            for found in (
                network.lanelets,
                scenario.dynamic_obstacles,
                scenario.static_obstacles,
                network.traffic_signs,
                network.traffic_lights,
            )
        ]
        if read != written or len(problems.planning_problem_dict) != 1:
            raise ValueError(f"read {read} lanelets, obstacles, signs and lights, written {written}")
    except Exception as error:
        failed += 1
        print(f"{file.parent.name}/{file.name}: {type(error).__name__}: {error}")
print(f"commonroad-io: {len(files)} files, {failed} failed")
sys.exit(0 if files and not failed else 1)
