"""A gymnasium-style policy as an ego: observations and actions are arrays of numbers, as `policy.predict(obs)` of
Stable-Baselines3 takes and gives them. Put your own network in the place of `Policy`, and its weights into driver.files."""

from evodrive_driver import local, pursuit, route_point, serve

NEIGHBOURS = 4


def observe(scene, step):
    """Speed, last steering, place beside the route, two points of the route, and the nearest road users."""
    ego = step["ego"]
    obs = [ego["speed_mps"] / 20.0, ego["steering_rad"], ego["route_offset_m"] / 5.0]
    for ahead_m in (5.0, 15.0):
        x, y = local(step, route_point(scene, step, ahead_m))
        obs += [x / 20.0, y / 20.0]
    near = step["neighbours"][:NEIGHBOURS]
    for other in near:
        x, y = local(step, other["position"])
        obs += [x / 100.0, y / 100.0]
    return obs + [1.0, 1.0] * (NEIGHBOURS - len(near))


class Policy:
    """Stands where a trained one would: it slows down for whoever is close ahead."""

    def predict(self, obs):
        x, y = 100.0 * obs[7], 100.0 * obs[8]
        blocked = 0.0 < x < 15.0 and abs(y) < 2.0
        return [-1.0 if blocked else 0.5 * (0.5 - obs[0])]


class Agent:
    def __init__(self, policy):
        self.policy = policy

    def decide(self, scene, step):
        (pedal,) = self.policy.predict(observe(scene, step))
        limit = scene["ego"]["acceleration_mps2_max"] if pedal > 0 else scene["ego"]["brake_mps2_max"]
        return max(-1.0, min(1.0, pedal)) * limit, pursuit(scene, step, max(4.0, 0.6 * step["ego"]["speed_mps"]))


serve(Agent(Policy()))
