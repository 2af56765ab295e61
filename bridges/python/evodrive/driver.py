"""Drive EvoDrive's ego from Python: this one file, no package. docs/EGOS.md describes the lines.

Give `serve` an object with a method `decide(scene, step)`, and if it keeps anything with a method `begin(scene)` that
forgets it. With an attribute `map_m` each step also holds the map within so many metres. Both arguments are the dictionaries of the protocol. `decide` returns `(acceleration_mps2, steering_rad)`, or a list
of points `[x, y]` where the car is to be 0.1 s, 0.2 s ... from now.

A run is only worth something if it comes out the same again: seed every random number from `scene["seed"]` in `begin`, and
keep nothing from one rollout to the next. EvoDrive plays a share of the rollouts again, in another process, and stops if they
differ: so does what hangs on the order of a set of texts, or on `hash()` of one.
"""

import json
import math
import sys


def serve(policy):
    """Speaks with EvoDrive until it closes standard input. Whatever else prints goes to standard error."""
    out, sys.stdout = sys.stdout, sys.stderr
    hello = {"evodrive_driver": 1}
    if getattr(policy, "map_m", None):
        hello["map_m"] = policy.map_m
    _say(out, hello)
    scene = None
    for line in sys.stdin:
        told = json.loads(line)
        if told["type"] == "begin":
            scene = told
            if hasattr(policy, "begin"):
                policy.begin(scene)
        elif told["type"] == "step":
            _say(out, _answered(policy.decide(scene, told), told))


def _answered(answer, step):
    """The line for what a policy decided. A number that is none is refused here, where its author reads what it was."""
    try:
        if isinstance(answer, tuple):
            acceleration_mps2, steering_rad = map(float, answer)
            message, numbers = {"acceleration_mps2": acceleration_mps2, "steering_rad": steering_rad}, answer
        else:
            points = [[float(x), float(y)] for x, y in answer]
            message, numbers = {"trajectory": points}, [value for point in points for value in point]
    except (TypeError, ValueError):
        numbers = [math.nan]
    if not numbers or not all(math.isfinite(value) for value in numbers):
        sys.exit(
            f"decide answered {answer!r} at {step['time_s']:.1f} s; expected (acceleration_mps2, steering_rad) or a list of "
            "points [x, y], all of them finite numbers"
        )
    return message


def _say(out, message):
    out.write(json.dumps(message, allow_nan=False) + "\n")
    out.flush()


def route_point(scene, step, ahead_m):
    """The point of the route this far ahead of the ego."""
    left = max(step["ego"]["route_s_m"], 0.0) + ahead_m
    points = scene["route"]
    for (ax, ay), (bx, by) in zip(points, points[1:]):
        length = math.hypot(bx - ax, by - ay)
        if left <= length and length > 0.0:
            share = left / length
            return ax + share * (bx - ax), ay + share * (by - ay)
        left -= length
    return tuple(points[-1])


def local(step, point):
    """A point as the ego sees it: metres ahead, metres to the left."""
    ego = step["ego"]
    dx, dy = point[0] - ego["position"][0], point[1] - ego["position"][1]
    cos, sin = math.cos(ego["heading_rad"]), math.sin(ego["heading_rad"])
    return cos * dx + sin * dy, -sin * dx + cos * dy


def pursuit(scene, step, ahead_m):
    """Steering along the arc through the route's point this far ahead (pure pursuit), radians, positive to the left."""
    return steering_to(scene, step, route_point(scene, step, ahead_m))


def steering_to(scene, step, point):
    """Steering along the arc through a point, radians, positive to the left."""
    x, y = local(step, point)
    wheelbase_m = 0.547 * scene["ego"]["length_m"]
    limit = scene["ego"]["steering_rad_max"]
    return max(-limit, min(limit, math.atan2(2.0 * wheelbase_m * y, max(x * x + y * y, 1.0))))
