"""The files that come with handsim."""
from __future__ import annotations

import difflib
from os import PathLike
from pathlib import Path
from typing import Union

from . import _core
from ._errors import input_error
from ._files import path_of


def data_path() -> Path:
    """The folder with the files that come with handsim: ``handmodels/``, ``controllers/`` and ``config/`` (scenes,
    persons, objects, studies)."""
    return Path(_core.data_folder())


def scenes() -> list[str]:
    """Names of the shipped scenes and studies, as `load` and the functions of `handsim.study` take them."""
    config = data_path() / "config"
    found = [*config.glob("*.yaml"), *config.glob("stability/*.yaml")]
    return sorted(str(path.relative_to(config).with_suffix("")) for path in found)


def find_file(name: Union[str, "PathLike[str]"], key: str = "scene", folder: str = "config") -> Path:
    """The path of a file, or of a shipped one by its name below the folder without ``.yaml``.

    :param key: what an error calls it
    :raises Error: of kind input, with the nearest name, where there is none
    """
    name = str(path_of(key, name))
    shipped = data_path() / folder / f"{name}.yaml"
    for path in (Path(name), shipped):
        try:
            if path.exists():
                return path
        except (OSError, ValueError) as error:  # a name that is too long, or has a zero byte
            raise input_error(key, repr(name), f"a path or a name ({error})") from None
    top = data_path() / folder
    known = scenes() if folder == "config" else [str(each.relative_to(top).with_suffix("")) for each in top.rglob("*.yaml")]
    near = difflib.get_close_matches(name, known, 1, 0.5)
    raise input_error(key, name, f"a path, or the name of a shipped file{' (handsim.scenes())' if folder == 'config' else ''}"
                      + (f"; nearest: {near[0]}" if near else ""))
