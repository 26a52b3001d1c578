"""What a scene is made from, and the changes of its keys, as texts that the program reads."""
from __future__ import annotations

import json
from os import PathLike, fspath
from typing import Any, Mapping, Optional, Union

import numpy as np

from ._errors import input_error

Source = Union[str, "PathLike[str]", Mapping[str, Any]]
Overrides = Optional[Mapping[str, Any]]
ENGINES = ("ode", "dae", "articulated", "auto")


def override_text(value: Any) -> str:
    """A value as the command line's ``--set key=value`` takes it. Text is passed on as it is: ``"5 ms"``, ``left``."""
    return value if isinstance(value, str) else str(fspath(value)) if isinstance(value, PathLike) else json_text(value)


def json_text(value: Any, key: str = "value") -> str:
    """JSON of mappings, lists, numbers, texts, paths and arrays of numpy. :raises Error: of kind input for others"""
    def plain(of: Any) -> Any:
        if isinstance(of, PathLike):
            return str(fspath(of))
        if isinstance(of, (np.ndarray, np.generic)):
            return of.tolist()
        if isinstance(of, Mapping):
            return dict(of)
        raise TypeError(f"{type(of).__name__} {of!r:.60}")

    try:
        return json.dumps(value, default=plain)
    except (TypeError, ValueError, RecursionError) as error:
        raise input_error(key, str(error), "mappings with names, lists, numbers, texts, paths and arrays") from None


def override_list(overrides: Overrides, engine: Optional[str] = None) -> list[str]:
    out = [] if engine is None else [f"solver.engine={engine}"]
    if not isinstance(overrides, (Mapping, type(None))):
        raise input_error("overrides", type(overrides).__name__, "a mapping: dotted key to value")
    return out + [f"{key}={override_text(value)}" for key, value in (overrides or {}).items()]


def command_overrides(options: Mapping[str, Any]) -> list[str]:
    """Of a command's ``--engine`` and ``--set``."""
    engine = options.get("--engine")
    if engine is not None and engine not in ENGINES:
        raise input_error("--engine", engine, f"one of {', '.join(ENGINES)}")
    return [*([f"solver.engine={engine}"] if engine else []), *options["--set"]]
