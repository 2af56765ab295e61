"""The intelligent driver model in twenty lines, as an ego of one's own."""

from evodrive_driver import local, pursuit, serve


class Idm:
    speed_mps, headway_s, gap_m, accelerate, brake = 11.0, 1.5, 2.0, 1.5, 3.0

    def decide(self, scene, step):
        ego, own = step["ego"], scene["ego"]
        v = ego["speed_mps"]
        free = 1.0 - (v / self.speed_mps) ** 4
        interaction = 0.0
        for other in step["neighbours"]:
            x, y = local(step, other["position"])
            if x > 0.0 and abs(y) < 0.5 * (own["width_m"] + other["width_m"]) + 0.3:
                gap = max(x - 0.5 * (own["length_m"] + other["length_m"]), 0.1)
                ahead = local({"ego": {**ego, "position": [0.0, 0.0]}}, other["velocity"])[0]
                wanted = self.gap_m + v * self.headway_s + v * (v - ahead) / (2 * (self.accelerate * self.brake) ** 0.5)
                interaction = max(interaction, (max(wanted, self.gap_m) / gap) ** 2)
        return self.accelerate * (free - interaction), pursuit(scene, step, max(4.0, 0.6 * v))


serve(Idm())
