"""Loads exported OpenSCENARIO 1.0 files with ScenarioRunner's own loader (0.9.11, its last release on PyPI): schema, version, road users
with their starts. CARLA itself is a program on a graphics card; in its place stands a client that has the map loaded already.

That release has no trajectories yet. Later ones look for `FollowTrajectoryAction/Trajectory/Shape/Polyline`, take a time of each vertex
and count it from the start of the action; this is looked at here."""

import logging
import pathlib
import shutil
import sys
import sysconfig
import types
from unittest.mock import MagicMock
from xml.etree import ElementTree

import qc_openscenario

# Who comes later has no place in Init, and the loader says so of each.
logging.disable(logging.WARNING)

SITE = pathlib.Path(sysconfig.get_paths()["purelib"])
# The wheel holds the packages of `srunner` beside each other, without that one and without the schema; `agents` comes with CARLA.
srunner = types.ModuleType("srunner")
srunner.__path__ = [str(SITE)]
sys.modules["srunner"] = srunner
AGENTS = ("", ".navigation", ".navigation.basic_agent", ".navigation.local_planner", ".navigation.global_route_planner")
AGENTS += (".navigation.global_route_planner_dao", ".navigation.roaming_agent", ".tools", ".tools.misc")
sys.modules.update({f"agents{name}": MagicMock() for name in AGENTS})
(SITE / "openscenario").mkdir(exist_ok=True)
shutil.copy(pathlib.Path(qc_openscenario.__file__).parent / "schema/1.0.0/OpenSCENARIO.xsd", SITE / "openscenario")

from srunner.scenarioconfigs.openscenario_configuration import OpenScenarioConfiguration  # noqa: E402


def check(file):
    """Loads a file, and gives the number of its road users."""
    client, root = MagicMock(), ElementTree.parse(file).getroot()
    road = root.find("RoadNetwork/LogicFile").get("filepath")
    # A town of CARLA's is named; another road lies beside the file.
    client.get_world.return_value.get_map.return_value.name = f"{file.parent.resolve()}/{road}" if road.endswith(".xodr") else road
    loaded = OpenScenarioConfiguration(str(file), client, {})
    actors = {actor.rolename: actor for actor in loaded.ego_vehicles + loaded.other_actors}
    objects = [element.get("name") for element in root.iter("ScenarioObject")]
    if sorted(actors) != sorted(objects) or len(loaded.ego_vehicles) != 1:
        raise ValueError(f"loaded {sorted(actors)}, the file has {sorted(objects)}")
    for private in root.iter("Private"):
        place, found = private.find(".//WorldPosition"), actors[private.get("entityRef")].transform.location
        # CARLA's y points to the right.
        if abs(found.x - float(place.get("x"))) > 1e-3 or abs(found.y + float(place.get("y"))) > 1e-3:
            raise ValueError(f"{private.get('entityRef')} starts at {found}")
    for action in root.iter("FollowTrajectoryAction"):
        times = [float(vertex.get("time")) for vertex in action.findall("Trajectory/Shape/Polyline/Vertex")]
        if len(times) < 2 or times[0] != 0.0 or times != sorted(set(times)):
            raise ValueError(f"a trajectory with the times {times[:3]} ..")
    return len(actors)


files = [file for folder in sys.argv[1:] for file in sorted(pathlib.Path(folder).rglob("*.xosc"))]
road_users = failed = 0
for file in files:
    try:
        road_users += check(file)
    except Exception as error:
        failed += 1
        print(f"{file}: {type(error).__name__}: {str(error)[:600]}", flush=True)
print(f"ScenarioRunner's loader: {len(files)} files with {road_users} road users, {failed} failed")
sys.exit(0 if files and not failed else 1)
