"""Reports, pages for a browser, and videos."""
from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path
from typing import Iterable, Optional, Union

from . import _core
from ._errors import input_error, real
from ._pictures import Picture, check_picture
from ._run_page import write_page

PathText = Union[str, "PathLike[str]"]


def report(folder: PathText, other: Optional[PathText] = None, *, out: Optional[PathText] = None) -> Path:
    """Writes one HTML page of a finished run or study, or of two runs in comparison, as ``handsim report``.

    :param folder: of a run (``scene.run(folder)``) or a study (``out=folder``)
    :param other: of a second run, which is drawn as a ghost
    :param out: path of the page; None: ``report.html`` in the first folder
    :returns: path of the page
    :raises Error: of kind input for other folders, and for runs in a build without three.js
    """
    folders = [Path(fspath(each)) for each in (folder, other) if each is not None]
    return write_page(folders, None if out is None else Path(fspath(out)))


def save_video(pictures: Iterable[Picture], path: PathText, fps: float = 30) -> None:
    """Writes pictures of one size as a video, by the program ffmpeg. The file appears when it is complete.

    :param pictures: arrays of shape (height, width, 3), dtype uint8; may be a generator
    :param path: ends in ``.mp4`` (H.264) or ``.gif``
    :param fps: pictures in a second; at most 240, in a GIF 50
    :raises Error: of kind input without pictures or without ffmpeg, or for a picture of another shape
    """
    video = None
    for picture in pictures:
        check_picture("pictures", picture)
        if video is None:
            video = _core.video(Path(fspath(path)), picture.shape[1], picture.shape[0], real("fps", fps))
        video.add(picture)
    if video is None:
        raise input_error("pictures", "none", "at least one")
    video.finish()
