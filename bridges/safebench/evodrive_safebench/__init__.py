"""Plays interventions that `evodrive program export --format intervention` wrote, as scenarios of SafeBench.

Nothing but Python is needed to import this. Inside SafeBench its base class and its data provider are used; the README says where the
folder goes and which configuration names it.
"""
import json

from .script import Ego, Script, to_carla

try:
    import carla
    from safebench.scenario.scenario_definition.basic_scenario import BasicScenario
    from safebench.scenario.scenario_manager.carla_data_provider import CarlaDataProvider
except ImportError:  # Outside SafeBench: the scripts alone.
    carla, CarlaDataProvider, BasicScenario = None, None, object

FORMAT = "evodrive-intervention/1"
# A blueprint of CARLA for each kind.
MODELS = {"vehicle": "vehicle.audi.tt", "cyclist": "vehicle.diamondback.century", "pedestrian": "walker.*",
          "static": "static.prop.vendingmachine"}
# Wheels of CARLA's cars turn so far, degrees, where a car does not say it.
STEER_DEG = 70.0
SPAWN_Z_M = 0.6
ATTEMPTS = 20


def read(intervention):
    """Checks an intervention (a file's name, or what it holds) and gives what it holds."""
    name = "intervention"
    if isinstance(intervention, str):
        name = intervention
        with open(intervention, encoding="utf-8") as file:
            intervention = json.load(file)
    found = intervention.get("format") if isinstance(intervention, dict) else type(intervention).__name__
    if found != FORMAT:
        raise ValueError(f"{name}: expected format {FORMAT}, found {found}; write it with evodrive program export --format intervention")
    strange = [tag for action in intervention["actions"] for tag in action if tag != "triggered"]
    if strange:
        raise ValueError(f"{name}: expected scripts that wait for the ego, found an action {strange[0]}")
    return intervention


class Intervention(BasicScenario):
    """A scenario whose actors do what an exported intervention says."""

    def __init__(self, world, ego_vehicle, config, timeout=60):
        super().__init__("EvoDriveIntervention", config, world)
        self.ego_vehicle, self.timeout = ego_vehicle, timeout
        self.ego_max_driven_distance = 200
        self.scripts = []

    def create_behavior(self, scenario_init_action):
        """Takes the intervention: loaded already by SafeBench's policy `hardcode`, or a file named as the scenario's parameters."""
        given = self.config.parameters if scenario_init_action is None else scenario_init_action
        intervention = read(given)
        town = CarlaDataProvider.get_map().name.split("/")[-1]
        if town != intervention["town"]:
            raise ValueError(f"{intervention['scene']}: expected the town {intervention['town']}, found {town}; load that town")
        self.scripts = [Script(action["triggered"]) for action in intervention["actions"]]
        # SafeBench asks for an update once the ego is as near as the farthest trigger; each script then asks for its own.
        self.trigger_distance_threshold = max(script.trigger["distance_m"] for script in self.scripts)

    def initialize_actors(self):
        self.other_actors = [self.spawned(script) for script in self.scripts]
        self.reference_actor = self.other_actors[self.scripts[0].trigger["reference"]]

    def spawned(self, script):
        x, y, yaw = script.spawn()
        ground = CarlaDataProvider.get_map().get_waypoint(carla.Location(x=x, y=y, z=0.0)).transform.location.z
        for attempt in range(ATTEMPTS):
            place = carla.Location(x=x, y=y, z=ground + SPAWN_Z_M + 0.1 * attempt)
            actor = CarlaDataProvider.request_new_actor(MODELS[script.kind], carla.Transform(place, carla.Rotation(yaw=yaw)))
            if actor is not None:
                actor.set_simulate_physics(enabled=True)
                return actor
        raise RuntimeError(f"expected room for a {script.kind} at x {x:.1f}, y {y:.1f}, found none; look what stands there")

    def update_behavior(self, scenario_action):
        ego = self.seen()
        for script, actor in zip(self.scripts, self.other_actors):
            reference = CarlaDataProvider.get_location(self.other_actors[script.trigger["reference"]])
            script.set_off(ego, (reference.x, reference.y))
            at = CarlaDataProvider.get_transform(actor)
            asked = script.step(at.location.x, at.location.y, at.rotation.yaw, CarlaDataProvider.get_velocity(actor), ego)
            if asked is not None:
                self.apply(script, actor, asked)

    def seen(self):
        at = CarlaDataProvider.get_transform(self.ego_vehicle)
        route = [(place.x, place.y) for place, _ in CarlaDataProvider.get_ego_vehicle_route() or []]
        return Ego(at.location.x, at.location.y, at.rotation.yaw, CarlaDataProvider.get_velocity(self.ego_vehicle), route)

    def apply(self, script, actor, asked):
        speed, throttle, brake, wheel_rad, direction = asked
        control = actor.get_control()
        if script.walks:
            control.speed, control.direction = speed, carla.Vector3D(direction[0], direction[1], 0.0)
        else:
            control.throttle, control.brake = throttle, brake
            # CARLA steers to the right, as a share of what the wheels can turn.
            _, _, right_deg = to_carla(0.0, 0.0, wheel_rad)
            control.steer = max(-1.0, min(1.0, right_deg / STEER_DEG))
        actor.apply_control(control)

    def check_stop_condition(self):
        """Nobody calls it: SafeBench's actors never stop by it."""
        return False


# SafeBench looks for its own names of the eight scenarios.
DynamicObjectCrossing = VehicleTurningRoute = OtherLeadingVehicle = ManeuverOppositeDirection = Intervention
OppositeVehicleRunningRedLight = SignalizedJunctionLeftTurn = SignalizedJunctionRightTurn = Intervention
NoSignalJunctionCrossingRoute = Intervention
