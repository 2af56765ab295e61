"""Carries out one script of an exported intervention, tick by tick: what it waits for, and what it asks of its body.

No simulator is needed. Places come and go in CARLA's frame (y to the right, yaw clockwise in degrees); inside they are in the file's
(y to the left, radians counter-clockwise).
"""
import math

DT_S = 0.1
# As EvoDrive's cars: they look this far ahead along a way, metres or seconds, and turn their wheels by so much a tick.
LOOK_AHEAD_M, LOOK_AHEAD_S, WALK_LOOK_M = 4.0, 0.6, 0.5
WHEEL_RAD, WHEEL_STEP_RAD, WHEELBASE_SHARE = math.radians(40.0), math.radians(4.0), 0.6
REACHED_M, PASSED_M = 0.5, 0.5


def from_carla(x, y, yaw_deg):
    return x, -y, -math.radians(yaw_deg)


def to_carla(x, y, heading_rad):
    return x, -y, -math.degrees(heading_rad)


def tagged(value):
    """Name and fields of one of several forms: `"forever"` or `{"driven": {"m": 5.0}}`."""
    if isinstance(value, str):
        return value, {}
    (name, fields), = value.items()
    return name, fields


class Ego:
    """What a script sees of the ego: place, speed and route."""

    def __init__(self, x, y, yaw_deg, speed_mps, route=()):
        self.x, self.y, self.heading = from_carla(x, y, yaw_deg)
        self.speed = speed_mps
        self.route = [(px, -py) for px, py in route]

    def beside_route(self, x, y):
        """Distance to the ego's route, metres; infinite where it is not known."""
        best = math.inf
        for (ax, ay), (bx, by) in zip(self.route, self.route[1:]):
            dx, dy = bx - ax, by - ay
            length = dx * dx + dy * dy
            share = 0.0 if length == 0.0 else min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / length))
            best = min(best, math.hypot(x - ax - share * dx, y - ay - share * dy))
        return best


class Script:
    """A script under way."""

    def __init__(self, script):
        self.kind, self.length = script["kind"], script["length_m"]
        (self.x, self.y), self.heading = script["spawn"]["position"], script["spawn"]["heading_rad"]
        self.trigger, self.phases = script["trigger"], script["phases"]
        self.awake, self.phase, self.tick, self.driven, self.wheel, self.origin = False, 0, 0, 0.0, 0.0, None
        self.walks = self.kind == "pedestrian"

    def spawn(self):
        """Where it stands: x, y, yaw in CARLA's frame."""
        return to_carla(self.x, self.y, self.heading)

    def set_off(self, ego, reference):
        """Wakes it where the ego is near its reference (x, y of CARLA) and moves as fast as asked."""
        rx, ry, _ = from_carla(*reference, 0.0)
        near = math.hypot(ego.x - rx, ego.y - ry) < self.trigger["distance_m"]
        self.awake = self.awake or (near and ego.speed >= self.trigger["ego_speed_mps_min"])

    def step(self, x, y, yaw_deg, speed_mps, ego):
        """One tick. `None` while it stands; else `(speed, throttle, brake, wheel_rad, direction)`: the speed asked for, what a car
        does for it, its wheels to the left, and the direction of a walker in CARLA's frame."""
        x, y, heading = from_carla(x, y, yaw_deg)
        self.driven += math.hypot(x - self.x, y - self.y) if self.awake else 0.0
        self.x, self.y, self.heading, self.speed = x, y, heading, speed_mps
        if not self.awake or not self.phases:
            return None
        while self.phase < len(self.phases) and self.over(self.phases[self.phase], ego):
            self.phase, self.tick, self.origin = self.phase + 1, 0, None
        if self.phase == len(self.phases):
            return 0.0, 0.0, 1.0, 0.0, (math.cos(heading), -math.sin(heading))
        phase = self.phases[self.phase]
        if self.origin is None:
            self.origin = (x, y, heading)
        asked = self.asked(phase["speed"], ego)
        slow = speed_mps <= asked
        wanted, direction = self.way(phase["way"])
        self.wheel += min(WHEEL_STEP_RAD, max(-WHEEL_STEP_RAD, wanted - self.wheel))
        self.tick += 1
        throttle, brake = (phase["throttle"], 0.0) if slow else (0.0, phase["brake"])
        return asked, throttle, brake, self.wheel, (direction[0], -direction[1])

    def over(self, phase, ego):
        name, of = tagged(phase["until"])
        if name == "driven":
            return self.driven >= of["m"]
        if name == "ego_within":
            return math.hypot(self.x - ego.x, self.y - ego.y) < of["m"]
        if name == "near_route":
            return ego.beside_route(self.x, self.y) < of["m"]
        if name == "lasted":
            return (self.tick + 0.5) * DT_S > of["s"]
        return False

    def asked(self, speed, ego):
        name, of = tagged(speed)
        if name == "constant":
            return of["mps"]
        if name == "profile":
            return of["mps"][min(self.tick, len(of["mps"]) - 1)]
        if name == "match_ego":
            return min(ego.speed, of["mps_max"])
        # Both reach the crossing of their ways at once.
        axis, dx, dy = (math.cos(ego.heading), math.sin(ego.heading)), self.x - ego.x, self.y - ego.y
        ahead, aside = dx * axis[0] + dy * axis[1], abs(axis[0] * dy - axis[1] * dx)
        if ahead < PASSED_M:
            return of["mps_max"]
        return min(of["mps_max"], max(of["mps_min"], aside * ego.speed / ahead))

    def way(self, way):
        """Wheels to the left, radians, and the direction on foot."""
        name, of = tagged(way)
        ahead = (math.cos(self.heading), math.sin(self.heading))
        look = WALK_LOOK_M if self.walks else max(LOOK_AHEAD_M, LOOK_AHEAD_S * self.speed)
        ox, oy, oh = self.origin
        if name == "straight":
            return 0.0, ahead
        if name == "wheel":
            angle = of["rad"][min(self.tick, len(of["rad"]) - 1)]
            return min(WHEEL_RAD, max(-WHEEL_RAD, angle)), ahead
        if name == "turn":
            turned = math.remainder(self.heading - oh, 2.0 * math.pi)
            left = math.copysign(1.0, of["left_rad"])
            direction = (math.cos(oh + of["left_rad"]), math.sin(oh + of["left_rad"]))
            return (0.0 if turned * left >= abs(of["left_rad"]) else self.wheel_for(left / of["radius_m"])), direction
        if name == "points":
            target = of["points"][min(self.tick, len(of["points"]) - 1)]
        elif name == "path":
            target = self.along(of["points"], look)
        else:
            gone = (self.x - ox) * math.cos(oh) + (self.y - oy) * math.sin(oh) + look
            share = min(1.0, max(0.0, gone / of["over_m"]))
            left = of["left_m"] * share * share * (3.0 - 2.0 * share)
            target = (ox + gone * math.cos(oh) - left * math.sin(oh), oy + gone * math.sin(oh) + left * math.cos(oh))
        dx, dy = target[0] - self.x, target[1] - self.y
        far = math.hypot(dx, dy)
        direction = (dx / far, dy / far) if far > 1e-9 else ahead
        if far < REACHED_M or dx * ahead[0] + dy * ahead[1] <= 0.0:
            return 0.0, direction
        return self.wheel_for(2.0 * (ahead[0] * dy - ahead[1] * dx) / (far * far)), direction

    def along(self, points, look):
        """The point of a path that lies so far behind the one nearest to it."""
        nearest = min(range(len(points)), key=lambda k: math.hypot(points[k][0] - self.x, points[k][1] - self.y))
        left = look
        for a, b in zip(points[nearest:], points[nearest + 1:]):
            part = math.hypot(b[0] - a[0], b[1] - a[1])
            if part >= left > 0.0:
                return a[0] + (b[0] - a[0]) * left / part, a[1] + (b[1] - a[1]) * left / part
            left -= part
        return points[-1]

    def wheel_for(self, curvature):
        return min(WHEEL_RAD, max(-WHEEL_RAD, math.atan(curvature * WHEELBASE_SHARE * self.length)))
