"""Policies as files of weights, which every command that takes an ego drives with (docs/FORMAT.md, docs/EGOS.md)."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from .. import _evodrive
from ..shown import shown
from .actions import Actions, Discrete
from .scenarios import HeldOut, Path_, Scenarios, _driver
from .spaces import Observation, Seen, standard

_NAMES = "latent_pi.0, latent_pi.2 .. (one to eight) and mu, each with weight and bias"
# torch's functions between layers, as a file names them.
_FUNCTIONS = {"ReLU": "relu", "Tanh": "tanh", "ELU": "elu", "GELU": "gelu", "SiLU": "silu"}


def save_policy(actor: Any, path: Path_, observation: str | Observation = "metadrive-1", squash: str | None = None) -> Path_:
    """Writes a policy as a file of weights that EvoDrive drives with, and gives the path.

    actor   a torch module of linear layers (one to eight hidden ones, with ReLU, Tanh, ELU, GELU or SiLU between them, and the action's
            means); a Stable-Baselines3 model (SAC, TD3, DDPG, PPO, A2C); or a dictionary of arrays named as in SB3's SAC:
            latent_pi.0.weight (hidden, numbers observed), latent_pi.0.bias, latent_pi.2.weight, .bias .., mu.weight, .bias, with ReLU
    squash  how means become an action: "tanh", or "clip" to [-1, 1]. Without it: tanh of SAC, of a module that ends with it, and
            of arrays; clip of PPO, A2C and other modules

    A file drives by a standard observation and gives steering and pedal, so no policy of `Discrete` actions, and none of an `Observation` with
    settings of its own, becomes one; `evaluate` drives both within this process.
    """
    Path(path).write_bytes(weights_of(actor, observation, squash))
    return path


def weights_of(actor: Any, observation: str | Observation = "metadrive-1", squash: str | None = None) -> bytes:
    """The bytes of `save_policy`; of a file or a function that gives a policy its own."""
    observation = standard(observation)
    if isinstance(actor, (bytes, str, os.PathLike)):
        _, weights = _driver(actor)
        if weights is None:
            raise TypeError(f"{shown(actor)} is no policy with weights; expected a module, a model, arrays or a file of weights")
        found = _evodrive.weights_observation(weights)
        if found != observation:
            raise ValueError(f"the weights drive by {found}, expected {observation}")
        return weights
    layers, activation, own_squash = _layers(actor)
    if layers is None:
        if callable(actor):
            return weights_of(actor(), observation, squash)
        raise TypeError(f"a {type(actor).__name__} is no policy; expected a torch module, an SB3 model, a dictionary of arrays")
    told = [(np.asarray(w, np.float32).tolist(), np.asarray(b, np.float32).tolist()) for w, b in layers]
    return _evodrive.weights(observation, told, activation, squash or own_squash)


def _layers(actor):
    """Layers, the function between them, and how means become actions; Nones of what is no policy."""
    if isinstance(actor, dict):
        hidden = sum(name.startswith("latent_pi.") and name.endswith(".weight") for name in actor)
        names = [*(f"latent_pi.{2 * i}" for i in range(max(hidden, 1))), "mu"]
        try:
            return [(actor[f"{name}.weight"], actor[f"{name}.bias"]) for name in names], "relu", "tanh"
        except KeyError as missing:
            raise ValueError(f"the arrays hold no {missing}; expected {_NAMES}") from None
    if hasattr(actor, "policy") and hasattr(actor, "get_vec_normalize_env"):
        return _of_sb3(actor)
    if hasattr(actor, "named_modules"):
        return _of_modules(actor)
    return None, None, None


def _of_modules(*parts, squash=None):
    """Of torch modules that follow each other."""
    import torch.nn as nn

    leaves = [leaf for part in parts for leaf in part.modules() if not list(leaf.children())]
    linear = [(leaf.weight.detach().cpu().numpy(), leaf.bias.detach().cpu().numpy()) for leaf in leaves if isinstance(leaf, nn.Linear)]
    between = [leaf for leaf in leaves if not isinstance(leaf, (nn.Linear, nn.Flatten, nn.Identity))]
    ends_with_tanh = bool(leaves) and isinstance(leaves[-1], nn.Tanh)
    kinds = {type(leaf).__name__ for leaf in (between[:-1] if ends_with_tanh else between)}
    function = _FUNCTIONS.get("".join(kinds)) if len(kinds) == 1 else None
    is_other = any(getattr(leaf, "alpha", 1.0) != 1.0 or getattr(leaf, "approximate", "none") != "none" for leaf in between)
    if not 2 <= len(linear) <= 9 or function is None or is_other:
        raise ValueError(
            f"the module has {len(linear)} linear layers with {sorted(kinds) or 'nothing'} between them; expected two to nine, the last one "
            f"the action's means, with one of {', '.join(_FUNCTIONS)} between them, of torch's defaults; export others as ONNX (docs/EGOS.md)"
        )
    return linear, function, squash or ("tanh" if ends_with_tanh else "clip")


def _of_sb3(model):
    policy = model.policy
    if not isinstance(model.action_space, Box):
        raise ValueError(
            f"the model's actions are {model.action_space}; expected steering and pedal from -1 to 1, which is what a file of weights gives; "
            "evaluate(model, scenes, actions=...) drives it within this process"
        )
    if hasattr(policy, "action_net"):  # PPO, A2C
        layers, activation, squash = _of_modules(policy.mlp_extractor.policy_net, policy.action_net, squash="clip")
    elif hasattr(policy.actor, "latent_pi"):  # SAC
        layers, activation, squash = _of_modules(policy.actor.latent_pi, policy.actor.mu, squash="tanh")
    else:  # TD3, DDPG
        layers, activation, squash = _of_modules(policy.actor.mu)
    normalized = model.get_vec_normalize_env()
    if normalized is not None and normalized.norm_obs:
        # What VecNormalize does to an observation goes into the first layer; its cut at clip_obs has no place there.
        (w, b), *rest = layers
        deviation = np.sqrt(normalized.obs_rms.var + normalized.epsilon)
        w = w / deviation
        layers = [(w, b - w @ normalized.obs_rms.mean), *rest]
    return layers, activation, squash


def _asked(policy, seen, taken):
    """A policy within Python as the engine asks it: bytes of observations and their count in, bytes of actions out. None of one that
    becomes a file of weights."""
    if not callable(policy) and not hasattr(policy, "predict"):
        return None
    try:
        if seen.name not in (None, "arrays-1") and taken.given is None and _layers(policy)[0] is not None:
            return None
    except ValueError:
        pass  # another network than that of a file
    answer = policy
    if hasattr(policy, "predict"):
        answer = lambda obs: policy.predict(obs, deterministic=True)[0]
    elif hasattr(policy, "named_modules"):
        answer = _module(policy)

    def ask(sheet, count):
        actions = np.asarray(answer(seen.views(np.frombuffer(sheet, np.float32).reshape(count, -1).copy())))
        shape = (count, *taken.space.shape)
        if actions.shape != shape or actions.dtype.kind not in "fiu":
            found = f"{actions.dtype} of shape {actions.shape}"
            raise ValueError(f"the policy gave {found} for {count} observations; expected numbers of shape {shape}: {taken.said} a row")
        actions = taken.driven(actions, lambda row: f"the policy, observation {row}: ")
        if not np.isfinite(actions).all():
            row, which = np.argwhere(~np.isfinite(actions))[0]
            raise ValueError(f"the policy gave {actions[row, which]} as action[{row}, {which}]; expected finite numbers, which are clipped to -1 .. 1")
        return np.clip(actions, -1.0, 1.0).astype("<f4").tobytes()

    return ask


def _module(module):
    import torch

    def answer(obs):
        device = next((of.device for of in module.parameters()), None)
        tensor = lambda of: torch.from_numpy(np.ascontiguousarray(of)).to(device)
        with torch.no_grad():
            return module({name: tensor(of) for name, of in obs.items()} if isinstance(obs, dict) else tensor(obs)).cpu().numpy()

    return answer


def evaluate(
    policy: Any,
    scenes: HeldOut | Scenarios,
    observation: str | Observation = "metadrive-1",
    threads: int = 0,
    actions: Discrete | None = None,
) -> dict[str, dict[str, Any]]:
    """How a policy drives, under each program planned around it: `evodrive apply`'s labels and `evodrive egos`' figures.

    policy  a file of weights, "idm", "idm-lights", "pdm", "frenet", "replay", "standing" (brakes and stands), whatever `save_policy` takes; or,
            within this process, a function, any other torch module (as it is: `eval()` is yours) or SB3 model: it is given the observations
            of all scenes that still go on (n, numbers; of "arrays-1" a dictionary) and gives actions (n, 2), clipped to -1 .. 1. Programs
            are planned around its drive; SafeBench's around IDM, without labels
    scenes  `scenarios.held_out`, or `Scenarios` for the scenes of the training
    observation, actions
            what such a function, module or model is given, and gives, as of `VecEnv`

    Gives a dictionary by program: scenes, crash_rate (anybody), off_road_rate, arrival_rate, route_completion, speed_mps, not_planned
    (scenes left out because the program cannot be planned there), and of programs attack, realism (by its protocol's name), coverage.
    """
    if not isinstance(scenes, (HeldOut, Scenarios)):
        raise TypeError(f"scenes is a {type(scenes).__name__}; expected scenarios.held_out, or Scenarios")
    held_out = isinstance(scenes, HeldOut)
    scenarios = scenes.scenarios if held_out else scenes
    seen, taken = Seen(observation), Actions(actions)
    if isinstance(policy, str) and policy in ("idm", "idm-lights", "pdm", "frenet", "replay", "standing"):
        name, weights = policy, None
    elif isinstance(policy, (str, os.PathLike)):
        name, weights = _driver(policy)
    elif ask := _asked(policy, seen, taken):
        return json.loads(_evodrive.evaluate_by(scenarios._native, ask, seen.plain, held_out, threads))
    else:
        name, weights = None, weights_of(policy, observation)
    if taken.given is not None:
        raise TypeError(f"{shown(policy)} gives steering and pedal; actions= goes with a function, a torch module or an SB3 model")
    return json.loads(_evodrive.evaluate(scenarios._native, name, weights, held_out, threads))
