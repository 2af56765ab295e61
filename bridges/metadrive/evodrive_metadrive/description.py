"""MetaDrive's ScenarioDescription from a scene: road, tracks and the ego, from the first simulated step on."""

import math
from typing import Any

import numpy as np
from metadrive.scenario.scenario_description import ScenarioDescription

from .request import Request

EGO = "ego"
TYPES = {"vehicle": "VEHICLE", "pedestrian": "PEDESTRIAN", "cyclist": "CYCLIST", "static": "VEHICLE"}
LANES = {
    "street": "LANE_SURFACE_STREET",
    "freeway": "LANE_FREEWAY",
    "bike": "LANE_BIKE_LANE",
    "other": "LANE_SURFACE_UNSTRUCTURE",
}
# A scene knows no heights; these are usual ones, metres.
HEIGHTS = {"vehicle": 1.5, "pedestrian": 1.75, "cyclist": 1.7, "static": 1.5}


def track_name(who: dict[str, int]) -> str:
    """The name of a road user in the description."""
    ((kind, index),) = who.items()
    return f"{kind}-{index}"


def points(line: list[list[float]]) -> np.ndarray:
    """A line as an array with heights of 0. [points, 3]"""
    return np.array([[x, y, 0.0] for x, y in line], dtype=np.float64)


def state(samples: list[dict[str, Any] | None], length_m: float, width_m: float, height_m: float) -> dict[str, np.ndarray]:
    """The arrays of a track; what was not observed is zero and not valid."""
    valid = np.array([s is not None for s in samples], dtype=bool)

    def rows(of, width):
        return np.array([of(s) if s is not None else [0.0] * width for s in samples], dtype=np.float64)

    size = lambda value: np.where(valid, value, 0.0)
    return {
        "position": rows(lambda s: [*s["position"], 0.0], 3),
        "heading": rows(lambda s: [s["heading_rad"]], 1)[:, 0],
        "velocity": rows(lambda s: s["velocity"], 2),
        "length": size(length_m),
        "width": size(width_m),
        "height": size(height_m),
        "valid": valid,
    }


def track(name: str, kind: str, samples: list, length_m: float, width_m: float) -> dict[str, Any]:
    """One road user."""
    written = TYPES[kind]
    return {
        "type": written,
        "state": state(samples, length_m, width_m, HEIGHTS[kind]),
        "metadata": {"track_length": len(samples), "type": written, "object_id": name, "dataset": "evodrive"},
    }


def cut(samples: list, request: Request, steps: int) -> list:
    """The samples of the simulated steps; a track that ends early has none afterwards."""
    shown = samples[request.first_step : request.first_step + steps + 1]
    return shown + [None] * (steps + 1 - len(shown))


def ego_samples(request: Request) -> list:
    """The ego's recorded samples. MetaDrive reads the first for the start and all of them for a replay; where a recording ends
    the last one is repeated, since MetaDrive's replay knows no end."""
    recorded = cut(request.scene["ego"]["track"]["samples"], request, request.steps)
    filled, last = [], recorded[0]
    for sample in recorded:
        last = sample if sample is not None else last
        filled.append(last)
    return filled


def road(scene: dict[str, Any]) -> dict[str, Any]:
    """The map's features."""
    lanes = scene["road"]["lanes"]
    features: dict[str, Any] = {}
    for index, lane in enumerate(lanes):
        features[f"lane-{index}"] = {
            "type": LANES[lane["kind"]],
            "polyline": points(lane["centre"]),
            "polygon": np.concatenate([points(lane["left"]), points(lane["right"])[::-1]])[:, :2],
            "entry_lanes": [f"lane-{i}" for i in lane["entries"]],
            "exit_lanes": [f"lane-{i}" for i in lane["exits"]],
            "left_neighbor": [],
            "right_neighbor": [],
            "speed_limit_kmh": 3.6 * (lane["speed_limit_mps"] or 100.0 / 3.6),
        }
    for index, edge in enumerate(scene["road"]["edges"]):
        features[f"edge-{index}"] = {"type": "ROAD_EDGE_BOUNDARY", "polyline": points(edge)}
    return features


def of(request: Request) -> ScenarioDescription:
    """The whole description. Lights are left out, as in CAT's protocol: the egos ignore them."""
    scene, steps = request.scene, request.steps
    commanded = {track_name(a.who): a for a in request.adversaries}
    box = scene["ego"]["track"]
    tracks = {EGO: track(EGO, "vehicle", ego_samples(request), box["length_m"], box["width_m"])}
    for index, recorded in enumerate(scene["tracks"]):
        name = f"track-{index}"
        if name not in commanded:
            samples = cut(recorded["samples"], request, steps)
            tracks[name] = track(name, recorded["kind"], samples, recorded["length_m"], recorded["width_m"])
    for name, adversary in commanded.items():
        tracks[name] = track(name, adversary.kind, adversary.samples, adversary.length_m, adversary.width_m)
    seen = {name: one for name, one in tracks.items() if one["state"]["valid"].any()}
    times = np.array([0.1 * k for k in range(steps + 1)], dtype=np.float64)
    return ScenarioDescription(
        {
            "id": request.key,
            "version": "MetaDrive v0.3.0.1",
            "length": steps + 1,
            "tracks": seen,
            "dynamic_map_states": {},
            "map_features": road(scene),
            "metadata": {
                "dataset": "evodrive",
                "scenario_id": request.key,
                "metadrive_processed": False,
                "coordinate": "right-handed",
                "ts": times,
                "sdc_id": EGO,
                "sdc_track_index": 0,
                "number_summary": {},
            },
        }
    )


def origin(request: Request) -> np.ndarray:
    """What MetaDrive subtracts from every position: the ego's first one, unless that is the origin already. [2]"""
    first = ego_samples(request)[0]["position"]
    place = np.array(first)
    return np.zeros(2) if abs(place[0] + place[1]) < 1e-3 else place


def route(request: Request) -> np.ndarray:
    """The path that the ego is to drive, in MetaDrive's coordinates. [points, 2]"""
    line = points(request.scene["ego"]["route"])[:, :2]
    apart = [True] + [math.hypot(*step) > 1e-6 for step in np.diff(line, axis=0)]
    return line[np.array(apart)] - origin(request)
