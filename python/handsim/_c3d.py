"""A recording of markers and rigid bodies in C3D as the table that `handsim track` reads.

ezc3d reads the file (pip install ezc3d); it is needed for this alone.
"""
from __future__ import annotations

import importlib.util
import json
import os
import re
import struct
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from typing import Iterator, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error, input_error
from ._model import quaternion_of

OBJECT = "object."
"""Before the name of a rigid body in the columns of a table, and in a file of names."""
TURNS = {"z": np.eye(3), "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])}
"""Of the file's axes into axes of which z points up, by the axis that points up in the file."""
ROTATION = 1e-3
"""Difference of a matrix times its transpose from 1 beyond which it is no rotation."""
UNITS = {"mm": "mm", "millimeter": "mm", "millimeters": "mm", "m": "m", "meter": "m", "meters": "m", "cm": "cm"}


def is_c3d(recording: Union[str, "PathLike[str]"]) -> bool:
    return Path(recording).suffix.lower() == ".c3d"


def read_names(path: Union[str, "PathLike[str]"]) -> dict[str, str]:
    """Names by label, from lines ``LABEL: NAME``. :raises Error: of kind input, with all wrong lines"""
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise input_error(str(path), str(getattr(error, "strerror", "") or "a text that is not UTF-8"), "a file of lines LABEL: NAME") from None
    out: dict[str, str] = {}
    problems = []
    for number, line in enumerate(lines, 1):
        text = line.partition(" #")[0].strip()
        if not text or text.startswith("#"):
            continue
        label, colon, name = (each.strip().strip("\"'") for each in text.rpartition(": "))
        if not colon or not label or not name:
            problems.append(f"{path}:{number}:1: got {text[:60]!r}, need LABEL: NAME")
        elif label in out or name in out.values():
            problems.append(f"{path}:{number}:1: {label}: got a label or a name twice, need each once")
        out[label] = name
    if problems:
        raise Error("\n".join(problems), "input")
    return out


READ = """
import json, sys
sys.path[:], path, out, limit = json.loads(sys.argv[1]), sys.argv[2], sys.argv[3], int(sys.argv[4])
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
except (ImportError, ValueError, OSError):
    pass
import numpy as np
import ezc3d
try:
    file = ezc3d.c3d(path)
    point, data = file["parameters"]["POINT"], np.asarray(file["data"]["points"], dtype=float)
    def text(name):
        value = point[name]["value"] if name in point else []
        return [str(each).strip() for each in value]
    labels = [each for name in ["LABELS", *(f"LABELS{i}" for i in range(2, 10))] for each in text(name)]
    rate = point["RATE"]["value"] if "RATE" in point else [0.0]
    found = {"rate": float(rate[0]), "first": int(file["header"]["points"]["first_frame"]), "labels": labels, "units": text("UNITS"), "screen": text("Y_SCREEN")}
    bodies, group = np.zeros((4, 4, 0, 0)), file["parameters"]["ROTATION"] if "ROTATION" in file["parameters"] else {}
    if "rotations" in file["data"]:
        bodies = np.asarray(file["data"]["rotations"], dtype=float)
    found["bodies"] = [str(each).strip() for name in ["LABELS", *(f"LABELS{i}" for i in range(2, 10))] if name in group for each in group[name]["value"]]
    np.savez(out, data=data, bodies=bodies, residuals=np.asarray(file["data"]["meta_points"]["residuals"], dtype=float)[0], found=json.dumps(found))
except (RuntimeError, OSError, ValueError, KeyError, IndexError, TypeError, MemoryError) as error:
    sys.exit((str(error).splitlines() or [type(error).__name__])[0][:200])
"""
"""What reads a file, in a process of its own: a spoilt one can end the process within ezc3d, or keep it busy for ever."""
SECONDS, BYTES = 20.0, 4e9
"""Limits of that process: each megabyte of the file adds a second and fifty megabytes."""


class Read(NamedTuple):
    """Of a file."""

    data: NDArray[np.float64]
    residuals: NDArray[np.float64]
    rate: float
    first: int
    labels: list[str]
    units: str
    screen: str
    bodies: NDArray[np.float64]
    """Rotation and place of each rigid body, shape (4, 4, bodies, frames)."""
    body_labels: list[str]


def _read(path: str) -> Read:
    """:raises Error: of kind input for a file that ezc3d cannot read within the limits"""
    size = 1e-6 * os.path.getsize(path)
    with tempfile.TemporaryDirectory(prefix="handsim_c3d_") as folder:
        out = os.path.join(folder, "read.npz")
        words = [sys.executable, "-c", READ, json.dumps(sys.path), path, out, str(int(BYTES + 50e6 * size))]
        try:
            done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, timeout=SECONDS + size)
        except subprocess.TimeoutExpired:
            raise input_error(path, f"a file that ezc3d does not end to read within {SECONDS + size:.0f} s", "a whole C3D file") from None
        if done.returncode:
            said = done.stderr.decode(errors="replace").strip().splitlines() or [f"it ended with {done.returncode}"]
            reason = f"signal {-done.returncode}" if done.returncode < 0 else said[-1][:200]
            raise input_error(path, f"a file that ezc3d cannot read ({reason})", "a whole C3D file")
        if not os.path.isfile(out):
            raise input_error(path, "a file that ezc3d cannot read (it gave nothing)", "a whole C3D file")
        with np.load(out) as arrays:
            data, residuals, bodies, found = arrays["data"], arrays["residuals"], arrays["bodies"], json.loads(str(arrays["found"]))
    labels = [_text(each) for each in found["labels"]]
    return Read(data, residuals, found["rate"], found["first"], (labels + [""] * data.shape[1])[:data.shape[1]], "".join(found["units"][:1]),
                "".join(found["screen"][:1]), bodies, [_text(each) for each in found["bodies"]])


def _text(label: str) -> str:
    """Older programs write labels in Latin-1; ezc3d gives their bytes as surrogates."""
    data = label.encode("utf-8", "surrogateescape")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _channels(labels: Sequence[str], names: Optional[dict[str, str]], bodies: Sequence[str], path: str) -> dict[str, int]:
    """Index of the point of each channel. A label may have its subject before a colon.

    :param bodies: labels of rigid bodies, which a file of names may have, too
    :raises Error: of kind input
    """
    out: dict[str, int] = {}
    short = [label.rpartition(":")[2] for label in labels]
    used: set[str] = set()
    for i, label in enumerate(labels):
        own = label if names is not None and label in names or short.count(short[i]) > 1 else short[i]
        if not own:
            continue
        used.add(own)
        name = (names or {}).get(own, own)
        for sign in ',[]"\n\r':
            name = name.replace(sign, "_")
        if name in out:
            raise input_error(path, f"two points that are {name}", "each name once, by --names")
        out[name] = i
    wrong = [label for label in names or {} if label not in used and label not in bodies]
    if wrong:
        known = ", ".join(each for each in (*labels, *bodies) if each)
        raise input_error("--names", ", ".join(wrong[:10]), f"labels of {path}: {known[:600]}")
    return out


def _unit_of(text: str, path: str) -> str:
    if text.lower() not in UNITS:
        raise input_error(path, f"POINT:UNITS {text!r}", "mm, cm or m")
    return UNITS[text.lower()]


def _up_of(said: str, up: Optional[str], path: str) -> str:
    if up not in (None, "y", "z"):
        raise input_error("--up", up, "y or z")
    said = said.upper()
    if up is None and said not in ("+Z", "Z", "+Y", "Y", ""):
        raise input_error(path, f"POINT:Y_SCREEN {said}", "+Y or +Z, or --up y or z for files that mean it otherwise")
    return up or ("y" if said.endswith("Y") else "z")


def _stated_frames(path: str) -> int:
    """As the head says; of longer files 65535. ezc3d itself takes a file that was cut for a shorter one."""
    try:
        with open(path, "rb") as file:
            head = file.read(10)
            if len(head) < 10 or head[1] != 0x50:
                raise input_error(path, "a file that is no C3D", "one whose second byte is 0x50")
            file.seek(512 * (max(1, head[0]) - 1) + 3)
            first, last = struct.unpack("<HH" if file.read(1) != b"\x56" else ">HH", head[6:])
    except OSError as error:
        raise input_error(path, f"a file that cannot be read ({error.strerror})", "a recording") from None
    return int(last) - int(first) + 1


def _body_columns(read: Read, names: Optional[dict[str, str]], up: str, unit: str, path: str) -> tuple[list[str], NDArray[np.float64]]:
    """Columns of rigid bodies, as of objects. :raises Error: of kind input"""
    count, frames = read.bodies.shape[2], read.data.shape[2]
    labels = (read.body_labels + [""] * count)[:count]
    if count == 0 or not any(labels):
        return [], np.zeros((frames, 0))
    # A whole number of samples may belong to each frame of the points.
    each = read.bodies.shape[3] // frames
    if read.bodies.shape[:2] != (4, 4) or each < 1 or read.bodies.shape[3] != each * frames:
        raise input_error(path, f"rotations of shape {read.bodies.shape} beside {frames} frames", "a 4 x 4 matrix of each rigid body in each frame")
    columns: list[str] = []
    out: list[NDArray[np.float64]] = []
    for label, matrices in zip(labels, read.bodies[..., ::each].transpose(2, 3, 0, 1)):
        if not label:
            continue
        name = re.sub(r"[^\w-]", "_", (names or {}).get(label, label.rpartition(":")[2]).removeprefix(OBJECT))
        parts = [f"{OBJECT}{name}.{part}" for part in (*(f"{axis}[{unit}]" for axis in "xyz"), "qw", "qx", "qy", "qz")]
        if parts[0] in columns:
            raise input_error(path, f"two rigid bodies that are {name}", "each name once, by --names")
        columns += parts
        rows = np.full((frames, 7), np.nan)
        for row, matrix in zip(rows, matrices):
            axes, place = matrix[:3, :3], matrix[:3, 3]
            # One that was not seen is NaN, or no rotation.
            if np.isfinite(matrix[:3]).all() and np.abs(axes @ axes.T - np.eye(3)).max() < ROTATION and np.linalg.det(axes) > 0:
                row[:3], row[3:] = TURNS[up] @ place, quaternion_of(TURNS[up] @ axes)
        out.append(rows)
    return columns, np.concatenate(out, axis=1)


def table_of(path: str, names: Optional[dict[str, str]] = None, up: Optional[str] = None) -> tuple[list[str], NDArray[np.float64]]:
    """Columns and rows as `handsim track` reads them from CSV. :raises Error: of kind input"""
    if importlib.util.find_spec("ezc3d") is None:
        raise input_error(path, "a Python without ezc3d", "it to read C3D: pip install ezc3d")
    if not Path(path).is_file():
        raise input_error(path, "no file", "a recording")
    stated = _stated_frames(path)
    read = _read(path)
    data, residuals, rate, first, labels, units, screen = read[:7]
    if data.ndim != 3 or data.shape[0] < 3 or residuals.shape != data.shape[1:]:
        raise input_error(path, f"points of shape {data.shape}", "x, y and z of each point and frame")
    if data.shape[2] < stated:
        raise input_error(path, f"{data.shape[2]} frames", f"{stated}, as its head says: is the file complete?")
    if not (np.isfinite(rate) and rate > 0):
        raise input_error(path, f"POINT:RATE {rate:g}", "frames in a second, above 0")
    if data.shape[1] == 0 or data.shape[2] == 0:
        raise input_error(path, f"{data.shape[1]} points in {data.shape[2]} frames", "one point and one frame at least")
    unit, up = _unit_of(units, path), _up_of(screen, up, path)
    channels = _channels(labels, names, read.body_labels, path)
    if not channels:
        raise input_error(path, "no label of a point", "labels in POINT:LABELS")
    places = data[:3].transpose(2, 1, 0)
    # Points that were not seen have a residual below 0, and in files of some programs the place 0 0 0.
    places = np.where((residuals.T[:, :, None] < 0) | ~places.any(axis=2, keepdims=True), np.nan, places)
    if up == "y":
        places = np.stack((places[..., 0], -places[..., 2], places[..., 1]), axis=-1)
    bodies, poses = _body_columns(read, names, up, unit, path)
    if unit == "cm":
        places, unit = places / 100, "m"
    rows = places[:, list(channels.values())].reshape(len(places), -1)
    times = (first + np.arange(len(places))) / rate
    columns = ["time[s]", *(f"{name}.{axis}[{unit}]" for name in channels for axis in "xyz")]
    return columns + bodies, np.concatenate((times[:, None], rows, poses), axis=1)


@contextmanager
def as_csv(path: Union[str, "PathLike[str]"], names: Union[None, str, "PathLike[str]"] = None, up: Optional[str] = None) -> Iterator[Path]:
    """The recording as a CSV file, while it is needed. :raises Error: of kind input"""
    columns, rows = table_of(str(path), None if names is None else read_names(names), up)
    with tempfile.TemporaryDirectory(prefix="handsim_c3d_") as folder:
        out = Path(folder) / f"{Path(path).name[-60:]}.csv"
        np.savetxt(out, rows, "%.17g", ",", header=",".join(columns), comments="", encoding="utf-8")
        try:
            yield out
        except Error as error:
            raise Error(str(error).replace(str(out), str(path)), error.kind,
                        [each._replace(file=str(path)) if each.file == str(out) else each for each in error.problems]) from None
