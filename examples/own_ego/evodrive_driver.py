"""Drive EvoDrive's ego from Python: this one file, no package. docs/EGOS.md describes the lines.

Give `serve` an object with a method `decide(scene, step)`; both arguments are the dictionaries of the protocol. It returns
`(acceleration_mps2, steering_rad)`, a list of points `[x, y]` where the car is to be 0.1 s, 0.2 s ... from now, or, where
`[driver] observe` names an observation (`step["observation"]`), an `Action(steering, pedal)`. It may raise `Abandon("word")`.
What else the object may have:

    begin(scene)    called before a rollout; it forgets what was kept. `scene["under"]` says under which program it is driven,
                    with `[driver] blind = false`
    end(scene, end) called behind it: `end["end"]`, `end["steps"]`, `end["labels"]` (collision, contact_class, adversary,
                    preventable, route_completion) and `end["outcome"]`, all that a record holds; without the last two where the
                    policy abandoned the scene
    map_m           metres around the ego within which each step also holds the map

A run is only worth something if it comes out the same again: seed every random number from `scene["seed"]` in `begin`, and
keep nothing from one rollout to the next. EvoDrive plays a share of the rollouts again, in another process, and stops if they
differ: so does what hangs on the order of a set of texts, or on `hash()` of one.
"""

import json
import math
import re
import sys
from typing import NamedTuple


class Action(NamedTuple):
    """Steering, positive to the left, and pedal, positive forwards, from -1 to 1: as a network of that observation answers."""

    steering: float
    pedal: float


class Abandon(Exception):
    """Raised in `begin` or `decide` where a policy does not want to drive, with one word that says why: the scene then has no
    label, is counted as abandoned, and the word is recorded. The next scene goes on in the same process."""

    def __init__(self, word="unnamed"):
        if not re.fullmatch(r"[A-Za-z0-9_-]{1,40}", word):
            raise ValueError(f"a scene is abandoned with {word!r}; expected one word of 1 to 40 letters, digits, - or _")
        super().__init__(word)


def serve(policy):
    """Speaks with EvoDrive until it closes standard input. Whatever else prints goes to standard error."""
    out, sys.stdout = sys.stdout, sys.stderr
    hello = {"evodrive_driver": 1}
    if getattr(policy, "map_m", None):
        hello["map_m"] = policy.map_m
    if hasattr(policy, "end"):
        hello["labels"] = True
    _say(out, hello)
    scene = abandoned = None
    for line in sys.stdin:
        told = json.loads(line)
        if told["type"] == "begin":
            scene, abandoned = told, None
            if hasattr(policy, "begin"):
                try:
                    policy.begin(scene)
                except Abandon as why:
                    abandoned = why
        elif told["type"] == "step":
            try:
                if abandoned:
                    raise abandoned
                message = _answered(policy.decide(scene, told), told)
            except Abandon as why:
                message = {"abandon": str(why)}
            _say(out, message)
        elif told["type"] == "end" and hasattr(policy, "end"):
            policy.end(scene, told)


def _answered(answer, step):
    """The line for what a policy decided. A number that is none is refused here, where its author reads what it was."""
    try:
        if isinstance(answer, Action):
            message, numbers = {"action": [float(value) for value in answer]}, answer
        elif isinstance(answer, tuple):
            acceleration_mps2, steering_rad = map(float, answer)
            message, numbers = {"acceleration_mps2": acceleration_mps2, "steering_rad": steering_rad}, answer
        else:
            points = [[float(x), float(y)] for x, y in answer]
            message, numbers = {"trajectory": points}, [value for point in points for value in point]
    except (TypeError, ValueError):
        numbers = [math.nan]
    if not numbers or not all(math.isfinite(value) for value in numbers):
        sys.exit(
            f"decide answered {answer!r} at {step['time_s']:.1f} s; expected (acceleration_mps2, steering_rad), a list of "
            "points [x, y] or an Action(steering, pedal), all of them finite numbers"
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
