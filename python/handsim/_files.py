"""Files that commands in Python write: each gets its name when it is complete."""
from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

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
