"""Pictures: arrays of bytes, shape (height, width, 3), from the top left."""
from __future__ import annotations

import struct
from os import PathLike
from typing import Any, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import input_error, whole
from ._files import check_target, write_file

Picture = NDArray[np.uint8]
Camera = tuple[Sequence[float], Sequence[float], float]
"""Position [m], target [m] and vertical field of view [rad]."""


def check_picture(key: str, picture: Any) -> None:
    array = isinstance(picture, np.ndarray)
    if not array or picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8 or picture.size == 0:
        got = f"shape {picture.shape}, dtype {picture.dtype}" if array else type(picture).__name__
        raise input_error(key, got, "shape (height, width, 3), dtype uint8")


def png(picture: Picture) -> bytes:
    """The bytes of a PNG file."""
    import zlib

    check_picture("picture", picture)
    height, width, _ = picture.shape

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    # Each row begins with its filter, 0: none.
    rows = np.zeros((height, 1 + 3 * width), np.uint8)
    rows[:, 1:] = picture.reshape(height, -1)
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows.tobytes(), 6))
            + chunk(b"IEND", b""))


def save_png(picture: Picture, path: Union[str, "PathLike[str]"]) -> None:
    """Writes a picture as a PNG file. :raises Error: of kind input where the path is that of another file; of kind output on a full disk"""
    content = png(picture)
    write_file(check_target("path", path, "png"), content)


def contact_sheet(pictures: Sequence[Picture], captions: Sequence[str], title: str = "",
                  width: int = 1600) -> Picture:
    """Pictures of one size on a page, in reading order, three to five in a row.

    :param captions: one for each picture
    :param width: largest width of the page [pixels], 160 to 16384
    :raises Error: of kind input without pictures (see ``has_pictures``), or for another number of captions
    """
    pages = list(pictures)
    for page in pages:
        check_picture("pictures", page)
    return _core.contact_sheet(pages, list(captions), title, whole("width", width, 160, 16384))


def html_picture(picture: Picture, width: int = 0) -> str:
    """An <img> with the picture in it."""
    import base64

    size = f' width="{width}"' if width else ""
    return f'<img{size} src="data:image/png;base64,{base64.b64encode(png(picture)).decode()}">'
