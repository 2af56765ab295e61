"""MetaDrive's scenario environment with what a request needs beside: commanded road users, a given route, contacts with names."""

from typing import Any

import numpy as np
from metadrive.component.traffic_participants.pedestrian import Pedestrian
from metadrive.component.vehicle.vehicle_type import vehicle_class_to_type
from metadrive.engine.core.collision_callback import collision_callback
from metadrive.envs import scenario_env
from metadrive.envs.scenario_env import ScenarioOnlineEnv
from metadrive.manager import scenario_traffic_manager
from metadrive.manager.scenario_data_manager import ScenarioOnlineDataManager
from metadrive.manager.scenario_map_manager import ScenarioMapManager
from metadrive.manager.scenario_traffic_manager import ScenarioTrafficManager
from metadrive.policy.idm_policy import TrajectoryIDMPolicy
from metadrive.policy.replay_policy import ReplayEgoCarPolicy
from metadrive.scenario.parse_object_state import get_idm_route
from panda3d.core import PythonCallbackObject

from . import description
from .request import Request


class EgoIDM(TrajectoryIDMPolicy):
    """MetaDrive's trajectory IDM as a driver under test: it renews its throttle at every decision step."""

    def act(self, *args, **kwargs):
        """[steering, throttle], each of -1 to 1."""
        return super().act(True)


EGO_POLICIES = {"idm": EgoIDM, "replay": ReplayEgoCarPolicy}


def environment(request: Request) -> ScenarioOnlineEnv:
    """A new environment for one request. There may be one at a time in a process."""
    commanded = {description.track_name(a.who) for a in request.adversaries}
    route = description.route(request)

    class RoutedMap(ScenarioMapManager):
        """Takes the scene's route for the ego's; MetaDrive would take the recorded positions."""

        def update_route(self):
            super().update_route()
            self.current_sdc_route = get_idm_route(route)

    class CommandedTraffic(ScenarioTrafficManager):
        """Commanded road users are replayed, wherever they appear."""

        def spawn_vehicle(self, v_id, track):
            if v_id not in commanded:
                return super().spawn_vehicle(v_id, track)
            filters = self._filter_overlapping_car
            # A vehicle that counts as static is replayed in any case.
            self._static_car_id.add(v_id)
            self._filter_overlapping_car = False
            super().spawn_vehicle(v_id, track)
            self._filter_overlapping_car = filters
            return None

    class Env(ScenarioOnlineEnv):
        """The managers are exchanged by name before they are made, so that they keep MetaDrive's order. The data manager, too:
        MetaDrive would read a data set of its assets and then put the online one in its place."""

        def setup_engine(self):
            ours = dict(
                ScenarioMapManager=RoutedMap,
                ScenarioTrafficManager=CommandedTraffic,
                ScenarioDataManager=ScenarioOnlineDataManager,
            )
            theirs = {name: getattr(scenario_env, name) for name in ours}
            vars(scenario_env).update(ours)
            try:
                super().setup_engine()
            finally:
                vars(scenario_env).update(theirs)

    return Env(
        dict(
            use_render=False,
            image_observation=False,
            show_interface=False,
            show_logo=False,
            log_level=50,
            agent_policy=EGO_POLICIES[request.ego],
            reactive_traffic=request.options.reactive_traffic,
            no_light=True,
            num_scenarios=1,
            start_scenario_index=0,
            horizon=None,
            store_map=False,
            # The observations are not used: as few rays as MetaDrive takes.
            vehicle_config=dict(
                lidar=dict(num_lasers=0, distance=50, num_others=0),
                lane_line_detector=dict(num_lasers=0, distance=50),
                side_detector=dict(num_lasers=0, distance=50),
            ),
        )
    )


def own_boxes(scenario: Any) -> None:
    """Gives every vehicle of a description a class of its own with the recorded box, in place of MetaDrive's four sizes."""
    for name, track in scenario["tracks"].items():
        if track["type"] == "VEHICLE" and name != description.EGO:
            state = track["state"]
            seen = np.flatnonzero(state["valid"])[0]
            length_m, width_m = float(state["length"][seen]), float(state["width"][seen])
            base = scenario_traffic_manager.get_vehicle_type(length_m)
            made = type(f"Boxed_{name}", (base,), {"DEFAULT_LENGTH": length_m, "DEFAULT_WIDTH": width_m})
            setattr(scenario_traffic_manager, made.__name__, made)
            # A vehicle looks itself up there while it is made.
            vehicle_class_to_type[made] = vehicle_class_to_type[base]
            track["metadata"]["spawn_info"] = {"type": (scenario_traffic_manager.__name__, made.__name__)}


def box(body: Any) -> list[float]:
    """Length and width of the shape that Bullet collides, metres. A pedestrian is a cylinder."""
    if isinstance(body, Pedestrian):
        return [2.0 * body.RADIUS, 2.0 * body.RADIUS]
    return [float(body.LENGTH), float(body.WIDTH)]


def arriving(before: tuple, after: tuple) -> tuple:
    """The places of one moment with the velocities of another, of the ego and of everyone else by name."""
    (ego_before, others_before), (ego, others) = before, after
    with_velocity = lambda pose, earlier: pose[:3] + earlier[3:]
    told = {name: with_velocity(pose, others_before.get(name, pose)) for name, pose in others.items()}
    return with_velocity(ego, ego_before), told


class Contacts:
    """Whom the ego touches, physics step by physics step.

    Bullet looks for contacts at the beginning of a physics step and changes speeds within it, and Panda shows bodies where they were at
    its beginning. So the moment of a contact has the places that are seen after the step, in which the boxes met, and the speeds
    of before it, with which they came there. The speeds after it are those after the impact.
    """

    def __init__(self, env: ScenarioOnlineEnv, moment):
        self.env, self.moment = env, moment
        self.substep, self.first = 0, None
        self.touched: list[str] = []
        engine = env.engine

        def note(contact):
            collision_callback(contact)
            self._note(contact.getNode0(), contact.getNode1())

        engine.physics_world.dynamic_world.setContactAddedCallback(PythonCallbackObject(note))
        step = engine.step_physics_world

        def stepped():
            self.touched = []
            before = self.moment() if self.first is None else None
            step()
            self.substep += 1
            if self.touched and self.first is None:
                # The lowest name, so that the order of Bullet's pairs decides nothing.
                name = min(self.touched)
                self.first = (self.substep, name, arriving(before, self.moment()), self.boxes(name))

        engine.step_physics_world = stepped

    def _note(self, *nodes) -> None:
        ego = self.env.agent.name
        names = [node.getPythonTag(node.getName()) for node in nodes]
        names = [tag.base_object_name if tag is not None else None for tag in names]
        if ego in names:
            known = self.env.engine.traffic_manager._obj_id_to_scenario_id
            self.touched += [known[name] for name in names if name in known]

    def begin_step(self) -> None:
        """Before each decision step."""
        self.substep = 0

    def boxes(self, name: str) -> dict[str, list[float]]:
        """Length and width, metres, of the ego and of a road user as MetaDrive simulates them."""
        manager = self.env.engine.traffic_manager
        other = manager.spawned_objects[manager._scenario_id_to_obj_id[name]]
        return {"ego": box(self.env.agent), "other": box(other)}
