"""Files of tables: CSV, the motion tables of OpenSim, HDF5; and JSON."""
from __future__ import annotations

from pathlib import Path
from typing import Any, Iterable, Sequence, Union

from ._errors import Error, Problem, input_error
from ._files import PathText, path_of
from ._table import Table, rows_table


def read_json(path: Path) -> Any:
    import json

    return json.loads(path.read_text())


def _value(text: str) -> Union[float, str, None]:
    if text == "":
        return None
    try:
        return float(text)
    except ValueError:
        return text


def at(path: Path, line: int, key: str, got: str, need: str) -> Error:
    """An input error with its line."""
    return Error(f"{path}:{line}:1: {key + ': ' if key else ''}got {got}, need {need}", "input", [Problem(str(path), line, 1, key, got, need)])


def _text(path: PathText) -> tuple[Path, str]:
    where = path_of("path", path)
    try:
        return where, where.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise input_error(str(where), str(getattr(error, "strerror", None) or "a file that is not text in UTF-8"), "a table") from None


def _rows(path: Path, names: Sequence[str], lines: Iterable[tuple[int, list[Any]]]) -> Table:
    """:raises Error: of kind input, with its line, for a row of another length and for a name that stands twice"""
    rows = []
    twice = [name for i, name in enumerate(names) if name in names[:i]]
    if not names or twice:
        raise at(path, 1, "columns", f"{twice[0]} twice" if twice else "none", "names, each once")
    for number, row in lines:
        if len(row) != len(names):
            raise at(path, number, "row", f"{len(row)} fields", f"{len(names)}, one for each column")
        rows.append(row)
    return rows_table(names, rows)


def read_csv(path: PathText) -> Table:
    """A CSV file of handsim as a table: columns of numbers as arrays, in which an empty field is nan.

    :raises Error: of kind input for a file that cannot be read, and with its line for a row that is longer or shorter than the head
    """
    import csv
    import io

    where, text = _text(path)
    reader = csv.reader(io.StringIO(text, newline=""))
    try:
        head: list[str] = next(reader, [])
        return _rows(where, head, ((reader.line_num, [_value(field) for field in row]) for row in reader if row))
    except csv.Error as error:
        raise at(where, reader.line_num, "row", str(error), "fields with commas between them") from None


def read_sto(path: PathText) -> Table:
    """A ``.sto`` or ``.mot`` file as a table of numbers; names are those of the file, angles in its unit. :raises Error: as `read_csv`"""
    where, text = _text(path)
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    first = next((i for i, (_, line) in enumerate(lines) if line.strip() == "endheader"), None)
    if first is None or first + 1 == len(lines):
        raise at(where, 1, "endheader", "no such line before a line of names", "a table of motion")

    def numbers(of: tuple[int, str]) -> tuple[int, list[Any]]:
        number, line = of
        try:
            return number, [float(field) for field in line.split("\t")]
        except ValueError as error:
            raise at(where, number, "row", str(error), "numbers") from None
    return _rows(where, lines[first + 1][1].rstrip("\n").split("\t"), map(numbers, lines[first + 2:]))


def read_h5(path: PathText, name: str = "rollouts") -> Table:
    """A table of a ``rollouts.h5``; texts are str. Needs h5py.

    :param name: ``rollouts``, the table of all, or ``trajectories/K``, the recorded states of rollout K
    :raises Error: of kind input where the file has no such table
    """
    import h5py

    where = path_of("path", path)
    if not isinstance(name, str):
        raise input_error("name", repr(name), "rollouts, or trajectories/K of a recorded rollout K")

    def column(data: Any) -> Any:
        return list(data.asstr()[:]) if h5py.check_string_dtype(data.dtype) else data[:]

    try:
        opened = h5py.File(where)
    except OSError as error:
        raise input_error(str(where), str(error), "an HDF5 file") from None
    with opened as file:
        if name == "rollouts" and name in file:
            return Table({key: column(data) for key, data in file[name].items()})
        if f"{name}.columns" not in file:
            raise input_error("name", repr(name), "rollouts, or trajectories/K of a recorded rollout K")
        return Table(dict(zip(column(file[f"{name}.columns"]), file[name][:].T)))
