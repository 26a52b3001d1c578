"""What tasks draw: numbers of a scene by its keys, with the ways of a study of rollouts."""
from __future__ import annotations

from typing import Any, Mapping, NamedTuple, Optional

import numpy as np

from .. import _core
from .._errors import input_error

Vary = Optional[Mapping[str, Any]]
WAYS = ("uniform", "log_uniform", "normal", "choice")
EACH_EPISODE = ("gravity", "gains", "torque_limits", "q")
"""With mass and friction of objects: what a batch draws anew for each episode; all else makes scenes, one for an episode."""


class Drawn(NamedTuple):
    """What `vary` says."""

    episodes: dict[str, tuple[str, float, float]]
    """For `Batch`'s randomise."""
    scenes: dict[str, Any]
    """The others: key to way, or to a value."""
    ends: list[dict[str, Any]]
    """Keys of objects that episodes draw, at an end or at their mean, as they are given: for the scene's reader to check."""


def _number(place: str, value: Any) -> float:
    number = _core.parse_quantity(value) if isinstance(value, str) else value
    if isinstance(number, bool) or not isinstance(number, (int, float, np.number)) or not np.isfinite(number):
        raise input_error(place, repr(value), "a finite number, with or without a unit")
    return float(number)


def _pair(place: str, way: str, given: Any) -> tuple[float, float]:
    """Ends, or mean and standard deviation."""
    if way == "normal":
        if not isinstance(given, Mapping) or set(given) != {"mean", "sd"}:
            raise input_error(place, repr(given), "{mean: , sd: }")
        mean, sd = _number(f"{place}.mean", given["mean"]), _number(f"{place}.sd", given["sd"])
        if sd < 0:
            raise input_error(f"{place}.sd", repr(given["sd"]), "0 or more")
        return mean, sd
    if not isinstance(given, (list, tuple)) or len(given) != 2:
        raise input_error(place, repr(given), "[low, high]")
    low, high = (_number(f"{place}.{i}", end) for i, end in enumerate(given))
    if low > high or (way == "log_uniform" and low <= 0):
        raise input_error(place, repr(given), "the lower end first" + (", above 0" if way == "log_uniform" else ""))
    return low, high


def _of_episodes(key: str) -> bool:
    return key in EACH_EPISODE or (key.startswith("objects.") and key.endswith((".mass", ".friction")))


def drawn_by(vary: Vary) -> Drawn:
    """:raises Error: of kind input with the key and the way"""
    out = Drawn({}, {}, [])
    if not isinstance(vary, (Mapping, type(None))):
        raise input_error("vary", repr(vary), 'a mapping: key of the scene to a value or a way, e.g. {"uniform": [low, high]}')
    for key, way in (vary or {}).items():
        place = f"vary.{key}"
        if not isinstance(way, Mapping):
            out.scenes[str(key)] = way
            continue
        if len(way) != 1 or next(iter(way)) not in WAYS:
            raise input_error(place, repr(dict(way)), f"one of {', '.join(WAYS)}")
        (name, given), = way.items()
        if name == "choice":
            if not isinstance(given, (list, tuple)) or not given:
                raise input_error(f"{place}.choice", repr(given), "a list of values")
        else:
            pair = _pair(f"{place}.{name}", name, given)
            if _of_episodes(str(key)):
                out.episodes[str(key)] = (name, *pair)
                if str(key).startswith("objects."):
                    out.ends.extend({str(key): end} for end in ([given["mean"]] if name == "normal" else given))
                continue
        out.scenes[str(key)] = dict(way)
    return out


def scene_values(scenes: Mapping[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """One draw: key to value, as `load` takes them."""
    out: dict[str, Any] = {}
    for key, way in scenes.items():
        if not isinstance(way, dict):
            out[key] = way
            continue
        (name, given), = way.items()
        if name == "choice":
            out[key] = given[int(random.integers(len(given)))]
            continue
        a, b = _pair(key, name, given)
        out[key] = float(random.normal(a, b) if name == "normal" else random.uniform(a, b) if name == "uniform"
                         else np.exp(random.uniform(np.log(a), np.log(b))))
    return out
