"""A rollout request as the worker needs it, checked while it is read."""

from dataclasses import dataclass
from typing import Any


class Refused(Exception):
    """A request that this worker cannot play; the text says why and goes into the answer."""


@dataclass(frozen=True)
class Adversary:
    """A road user whose motion is commanded at every step."""

    who: dict[str, int]
    kind: str
    length_m: float
    width_m: float
    # One a simulated step; None while it is not there.
    samples: list[dict[str, Any] | None]


@dataclass(frozen=True)
class Options:
    """What the experiment declares for this backend; see docs/BACKENDS.md."""

    # Whether vehicles that appear behind the ego follow it by MetaDrive's IDM, as MetaDrive has it.
    reactive_traffic: bool
    # "metadrive": traffic has the boxes of MetaDrive's vehicle classes; "recorded": those of the scene.
    traffic_boxes: str


@dataclass(frozen=True)
class Request:
    """One rollout."""

    key: str
    scene: dict[str, Any]
    first_step: int
    steps: int
    ego: str
    seed: int
    adversaries: list[Adversary]
    options: Options


EGOS = ("idm", "replay")
BOXES = ("metadrive", "recorded")


def read(line: dict[str, Any]) -> Request:
    """From the parsed line. Raises Refused for what this worker does not know."""
    options = dict(line["options"])
    reactive = options.pop("reactive_traffic", None)
    boxes = options.pop("traffic_boxes", None)
    if options or not isinstance(reactive, bool) or boxes not in BOXES:
        raise Refused(
            f"options are {line['options']}, expected reactive_traffic = true or false and traffic_boxes = one of {', '.join(BOXES)}"
        )
    if line["ego"] not in EGOS:
        raise Refused(f"the ego is {line['ego']!r}, this worker has {', '.join(EGOS)}")
    scene = line["scene"]
    first, steps = int(line["first_step"]), int(line["steps"])
    if scene.get("staging") is not None:
        raise Refused("the scene is staged for SafeBench, whose rules MetaDrive does not have")
    adversaries = [
        Adversary(a["who"], a["kind"], float(a["length_m"]), float(a["width_m"]), a["samples"]) for a in line["adversaries"]
    ]
    for adversary in adversaries:
        if len(adversary.samples) != steps + 1:
            raise Refused(f"an adversary has {len(adversary.samples)} samples, expected {steps + 1}")
    return Request(line["request"], scene, first, steps, line["ego"], int(line["seed"]), adversaries, Options(reactive, boxes))
