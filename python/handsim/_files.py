"""What commands in Python share: their options, and files that get their names when they are complete."""
from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, Sequence

from ._errors import Error, Problem, input_error

if TYPE_CHECKING:
    from ._scene import Scene


def standing_alone(scene: "Scene") -> dict[str, bytes]:
    """By name: scene.yaml and what it reads."""
    files: dict[str, bytes] = scene._core.standalone()
    return {"scene.yaml" if name == "resolved.yaml" else name: content for name, content in files.items()}


def write(out: Path, files: dict[str, bytes], quiet: bool = False) -> None:
    for name, content in files.items():
        path = out / name
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(f".{path.name}.part")
        part.write_bytes(content)
        os.replace(part, path)
    if not quiet:
        print(f"wrote {', '.join(str(out / name) for name in files)}", file=sys.stderr)


def read_options(command: str, arguments: Sequence[str], place: str, flags: Sequence[str], values: Sequence[str],
                 required: Sequence[str]) -> dict[str, Any]:
    """Options by their names, ``--set`` a list, and the one argument without a name by ``place``."""
    out: dict[str, Any] = {"--set": []}
    places: list[str] = []
    rest = iter(arguments)
    for each in rest:
        name, equals, value = each.partition("=") if each.startswith("--") else (each, "", "")
        if name in flags:
            out[name] = True
        elif name in values:
            given = value if equals else next(rest, "")
            if not given:
                raise input_error(name, "nothing", "a value")
            if name == "--set":
                out[name].append(given)
            else:
                out[name] = given
        elif each.startswith("-"):
            raise input_error(each, "an unknown option", f"one of handsim {command} --help")
        else:
            places.append(each)
    wrong = {name: "nothing" for name in required if name not in out}
    if len(places) != 1:
        wrong[place] = str(len(places) or "nothing")
    if wrong:
        raise Error("\n".join(f"{name}: got {got}, need one" for name, got in wrong.items()), "input",
                    [Problem(None, None, None, name, got, "one") for name, got in wrong.items()])
    return {**out, place: places[0]}
