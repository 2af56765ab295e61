"""The scenario class in a stand-in of SafeBench's interface: its base class, its data provider, its manager's loop, bodies that move."""
import importlib
import json
import math
import pathlib
import sys
import types

import pytest

HOME = pathlib.Path(__file__).resolve().parent
WALKER = HOME / "walker.json"


class Place(types.SimpleNamespace):
    pass


class Body:
    """A car or walker of the stand-in: full throttle 2.76 m/s2, full brake 8.83 m/s2, wheels that turn it."""

    def __init__(self, number, model, transform):
        self.id, self.type_id, self.alive = number, model, True
        self.x, self.y, self.yaw, self.speed = transform.location.x, transform.location.y, transform.rotation.yaw, 0.0
        self.control, self.applied = None, 0

    def set_simulate_physics(self, enabled):
        assert enabled

    def set_autopilot(self, enabled):
        assert not enabled

    def get_control(self):
        return Place(throttle=0.0, brake=0.0, steer=0.0, speed=0.0, direction=None)

    def apply_control(self, control):
        self.control, self.applied = control, self.applied + 1

    def move(self, dt=0.1):
        control = self.control
        if control is None:
            return
        if self.type_id.startswith("walker"):
            self.speed = control.speed
            self.x += control.direction.x * control.speed * dt
            self.y += control.direction.y * control.speed * dt
            return
        self.speed = max(0.0, self.speed + (2.76 * control.throttle - 8.83 * control.brake) * dt)
        self.yaw += math.degrees(self.speed * math.tan(math.radians(70.0) * control.steer) / 2.9 * dt)
        self.x += self.speed * math.cos(math.radians(self.yaw)) * dt
        self.y += self.speed * math.sin(math.radians(self.yaw)) * dt


class World:
    """Stands in for the modules of CARLA and SafeBench that the class imports."""

    def __init__(self, town="Town01"):
        self.town, self.bodies, self.refused, self.route = town, [], 0, []
        self.ego = Body(0, "vehicle.lincoln.mkz_2017", self.transform(0.0, 0.0, 0.0))

    @staticmethod
    def transform(x, y, yaw):
        return Place(location=Place(x=x, y=y, z=0.0), rotation=Place(yaw=yaw))

    def tick(self):
        pass

    def modules(self):
        world = self

        class Provider:
            @staticmethod
            def get_map():
                waypoint = Place(transform=Place(location=Place(z=1.5)))
                return Place(name="Carla/Maps/" + world.town, get_waypoint=lambda location: waypoint)

            @staticmethod
            def request_new_actor(model, spawn):
                if world.refused:
                    world.refused -= 1
                    return None
                world.bodies.append(Body(1 + len(world.bodies), model, spawn))
                return world.bodies[-1]

            @staticmethod
            def get_transform(body):
                return world.transform(body.x, body.y, body.yaw)

            @staticmethod
            def get_location(body):
                return Place(x=body.x, y=body.y, z=0.0)

            @staticmethod
            def get_velocity(body):
                return body.speed

            @staticmethod
            def get_ego_vehicle_route():
                return world.route

            @staticmethod
            def is_sync_mode():
                return True

            @staticmethod
            def actor_id_exists(number):
                return True

            @staticmethod
            def remove_actor_by_id(number):
                world.bodies = [body for body in world.bodies if body.id != number]

        class BasicScenario:
            """As SafeBench's: what it sets and what its clean_up does."""

            def __init__(self, name, config, world, first_env=False):
                self.world, self.name, self.config = world, name, config
                self.reference_actor, self.other_actors, self.trigger_distance_threshold = None, [], None
                self.ego_max_driven_distance = 200
                world.tick()

            def clean_up(self):
                for actor in self.other_actors:
                    if actor.type_id.startswith("vehicle"):
                        actor.set_autopilot(enabled=False)
                    if Provider.actor_id_exists(actor.id):
                        Provider.remove_actor_by_id(actor.id)
                self.other_actors = []

        carla = types.ModuleType("carla")
        carla.Location = lambda x, y, z: Place(x=x, y=y, z=z)
        carla.Rotation = lambda yaw: Place(yaw=yaw)
        carla.Transform = lambda location, rotation: Place(location=location, rotation=rotation)
        carla.Vector3D = lambda x, y, z: Place(x=x, y=y, z=z)
        base = types.ModuleType("safebench.scenario.scenario_definition.basic_scenario")
        base.BasicScenario = BasicScenario
        provider = types.ModuleType("safebench.scenario.scenario_manager.carla_data_provider")
        provider.CarlaDataProvider = Provider
        names = ["safebench", "safebench.scenario", "safebench.scenario.scenario_definition", "safebench.scenario.scenario_manager"]
        return {"carla": carla, base.__name__: base, provider.__name__: provider, **{name: types.ModuleType(name) for name in names}}


@pytest.fixture
def loaded(monkeypatch):
    """The package as it is imported inside SafeBench, for a world."""
    monkeypatch.syspath_prepend(str(HOME.parent))

    def load(world):
        for name in [name for name in sys.modules if name.startswith("evodrive_safebench")]:
            monkeypatch.delitem(sys.modules, name)
        for name, module in world.modules().items():
            monkeypatch.setitem(sys.modules, name, module)
        return importlib.import_module("evodrive_safebench")

    return load


def intervention(**changes):
    return {**json.loads(WALKER.read_text()), **changes}


def scenario(loaded, world, given):
    # As SafeBench's route scenario finds the class of family 1, and as its manager begins a run.
    made = getattr(loaded(world), "DynamicObjectCrossing")(world, world.ego, Place(parameters=None), timeout=60)
    made.create_behavior(given)
    made.initialize_actors()
    return made


def run(world, made, ticks, ego_mps):
    """SafeBench's loop: a scenario is triggered by its reference actor's distance, and updated from then on."""
    triggered, seen = False, []
    for _ in range(ticks):
        near = math.hypot(world.ego.x - made.reference_actor.x, world.ego.y - made.reference_actor.y)
        triggered = triggered or near < made.trigger_distance_threshold
        if triggered:
            made.update_behavior(None)
        for body in world.bodies:
            body.move()
        world.ego.speed = ego_mps
        world.ego.x += 0.1 * ego_mps
        seen.append([(body.x, body.y, body.speed) for body in world.bodies])
    return seen


def test_everybody_stands_where_the_file_says_seen_in_carlas_frame(loaded):
    world = World()
    scenario(loaded, world, intervention())
    walker, machine = world.bodies
    script = intervention()["actions"][0]["triggered"]["spawn"]
    assert (walker.x, walker.y) == (script["position"][0], -script["position"][1])
    assert walker.yaw == pytest.approx(-math.degrees(script["heading_rad"]))
    assert (walker.type_id, machine.type_id) == ("walker.*", "static.prop.vendingmachine")


def test_a_walker_waits_for_the_ego_crosses_at_its_speed_and_stops_after_its_way(loaded):
    world = World()
    made = scenario(loaded, world, intervention())
    script = intervention()["actions"][0]["triggered"]
    start = (world.bodies[0].x, world.bodies[0].y)
    seen = run(world, made, 120, 5.0)
    moved = next(k for k, bodies in enumerate(seen) if bodies[0][:2] != start)
    near = math.hypot(0.5 * moved - start[0], start[1])
    assert near < script["trigger"]["distance_m"] <= near + 0.5, "not a tick too early or too late"
    assert seen[moved][0][2] == script["phases"][0]["speed"]["constant"]["mps"]
    far = math.hypot(seen[-1][0][0] - start[0], seen[-1][0][1] - start[1])
    asked = script["phases"][0]["until"]["driven"]["m"]
    assert asked <= far < asked + 0.3
    # It crosses toward the road: in CARLA's frame against y.
    assert seen[-1][0][1] < start[1] and abs(seen[-1][0][0] - start[0]) < 1e-6
    assert [bodies[1] for bodies in seen] == [seen[0][1]] * len(seen), "what is static stays"


def test_nobody_moves_while_the_ego_is_far_or_stands_where_it_has_to_move(loaded):
    world = World()
    seen = run(world, scenario(loaded, world, intervention()), 50, 0.0)
    assert seen[-1] == seen[0] and all(body.applied == 0 for body in world.bodies)
    slow = intervention()
    slow["actions"][0]["triggered"]["trigger"]["ego_speed_mps_min"] = 6.0
    world = World()
    made = scenario(loaded, world, slow)
    assert run(world, made, 120, 5.0)[-1] != [] and world.bodies[0].applied == 0
    assert run(world, made, 20, 7.0)[-1] and world.bodies[0].applied == 0, "the ego has passed by now"


def car(phases, trigger_m=1000.0):
    trigger = {"reference": 0, "distance_m": trigger_m, "ego_speed_mps_min": 0.0}
    spawn = {"position": [60.0, 20.0], "heading_rad": -math.pi / 2}
    script = {"kind": "vehicle", "length_m": 4.8, "width_m": 2.0, "spawn": spawn, "trigger": trigger, "phases": phases}
    return intervention(actions=[{"triggered": script}])


def phase(speed, way="straight", until="forever"):
    return {"speed": speed, "way": way, "throttle": 1.0, "brake": 1.0, "until": until}


def test_a_car_drives_bang_bang_goes_through_its_phases_and_brakes_at_the_end(loaded):
    world = World()
    constant = {"constant": {"mps": 6.0}}
    made = scenario(loaded, world, car([phase(constant, until={"driven": {"m": 12.0}}), phase({"constant": {"mps": 2.0}}, until={"lasted": {"s": 3.0}})]))
    seen = run(world, made, 150, 0.0)
    speeds = [bodies[0][2] for bodies in seen]
    assert max(speeds) == pytest.approx(6.0, abs=0.3) and speeds[-1] == 0.0
    slow = [k for k, mps in enumerate(speeds) if k > speeds.index(max(speeds)) and 1.0 < mps < 3.0]
    assert 25 <= len(slow) <= 36, slow
    assert seen[-1][0][1] > -20.0 and seen[-1][0][0] == pytest.approx(60.0), "straight toward the road"


def test_a_sequence_of_speeds_is_played_one_a_tick_and_its_last_repeated(loaded):
    world = World()
    asked = [2.5] * 10 + [0.0] * 10 + [1.5]
    walks = car([phase({"profile": {"mps": asked}})])
    walks["actions"][0]["triggered"]["kind"] = "pedestrian"
    seen = run(world, scenario(loaded, world, walks), 40, 0.0)
    assert [bodies[0][2] for bodies in seen] == asked + [1.5] * 19


def test_who_moves_to_the_left_moves_to_the_left_as_carla_sees_it(loaded):
    for left_m in (3.0, -3.0):
        world = World()
        made = scenario(loaded, world, car([phase({"constant": {"mps": 8.0}}, way={"shift": {"left_m": left_m, "over_m": 20.0}})]))
        run(world, made, 80, 0.0)
        # It drives south in the file's frame, so its left is east: x grows.
        assert world.bodies[0].x == pytest.approx(60.0 + left_m, abs=0.7), left_m


def test_who_meets_the_ego_or_its_route_reads_them_in_one_frame(loaded):
    world = World()
    world.route = [(Place(x=0.0, y=0.0), None), (Place(x=200.0, y=0.0), None)]
    meets = car([phase({"intercept": {"mps_min": 0.0, "mps_max": 9.0}}, until={"near_route": {"m": 1.0}})])
    meets["actions"][0]["triggered"]["kind"] = "pedestrian"
    made = scenario(loaded, world, meets)
    run(world, made, 100, 4.0)
    # On one line of sight all the way: both would reach the crossing at once.
    assert abs(world.bodies[0].y) / (60.0 - world.ego.x) == pytest.approx(20.0 / 60.0, abs=0.02)
    run(world, made, 60, 4.0)
    assert 0.5 < abs(world.bodies[0].y) <= 1.0, "it stopped before the route"


def test_another_town_another_format_and_other_actions_are_refused_by_name(loaded):
    with pytest.raises(ValueError, match="expected the town Town02, found Town01"):
        scenario(loaded, World(), intervention(town="Town02"))
    with pytest.raises(ValueError, match="expected format evodrive-intervention/1, found evodrive-program/1"):
        scenario(loaded, World(), intervention(format="evodrive-program/1"))
    with pytest.raises(ValueError, match="found an action follow"):
        scenario(loaded, World(), intervention(actions=[{"follow": {}}]))


def test_a_taken_place_is_tried_higher_up_and_then_told(loaded):
    world = World()
    world.refused = 3
    scenario(loaded, world, intervention())
    assert len(world.bodies) == 2
    world = World()
    world.refused = 1000
    with pytest.raises(RuntimeError, match="expected room for a pedestrian"):
        scenario(loaded, world, intervention())


def test_a_file_is_read_where_no_policy_loads_it_and_clean_up_removes_everybody(loaded, tmp_path):
    world = World()
    made = loaded(world).NoSignalJunctionCrossingRoute(world, world.ego, Place(parameters=str(WALKER)), timeout=60)
    made.create_behavior(None)
    made.initialize_actors()
    assert len(world.bodies) == 2 and made.reference_actor is world.bodies[0]
    made.clean_up()
    assert world.bodies == [] and made.other_actors == []


def test_the_package_is_imported_without_safebench(monkeypatch):
    monkeypatch.syspath_prepend(str(HOME.parent))
    for name in [name for name in sys.modules if name.startswith(("evodrive_safebench", "safebench", "carla"))]:
        monkeypatch.delitem(sys.modules, name)
    alone = importlib.import_module("evodrive_safebench")
    assert alone.CarlaDataProvider is None and alone.read(str(WALKER))["town"] == "Town01"
