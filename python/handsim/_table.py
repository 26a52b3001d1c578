"""Quantities by name, with their units; tables: dicts of columns that show themselves."""
from __future__ import annotations

import html
import re
from collections import Counter
from typing import TYPE_CHECKING, Any, Iterator, Mapping, Sequence, Union

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas

Column = Union[NDArray[Any], Sequence[Any]]
MOST_ROWS = 40
AXES = {2: "xy", 3: "xyz", 4: "wxyz"}
UNIT = re.compile(r"(.+)\[([^\[\]]*)\]")


def text_of(value: object) -> str:
    if isinstance(value, (float, np.floating)):
        return "" if np.isnan(value) else f"{value:.4g}"
    if isinstance(value, np.ndarray):
        return ", ".join(text_of(each) for each in value.tolist())
    return "" if value is None else str(value)


class Quantities(dict[str, Any]):
    """Values by name: ``sizes["length"]``; their units are ``sizes.units["length"]``.

    A name with its unit, as in handsim's files, finds the value as well: ``sizes["length[m]"]``. Where two names differ by
    their units alone, both keep them.
    """

    units: dict[str, str]
    """By name; empty for numbers without a unit and for texts."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        parts = {key: match.groups() if (match := UNIT.fullmatch(key)) else (key, "") for key in values}
        uses = Counter(stem for stem, _ in parts.values())
        names = {key: stem if uses[stem] == 1 else key for key, (stem, _) in parts.items()}
        super().__init__({names[key]: value for key, value in values.items()})
        self.units = {names[key]: unit for key, (_, unit) in parts.items()}

    def with_unit(self, name: str) -> str:
        """The name as in handsim's files: ``length[m]``."""
        unit = self.units.get(name, "")
        return f"{name}[{unit}]" if unit and not UNIT.fullmatch(name) else name

    def __missing__(self, key: str) -> Any:
        match = UNIT.fullmatch(key) if isinstance(key, str) else None
        if match is None or match[1] not in self or self.units.get(match[1]) != match[2]:
            raise KeyError(key)
        return self[match[1]]

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), ({self.with_unit(name): value for name, value in self.items()},)


class Table(Quantities):
    """Columns by name, all of one length, with their `units`.

    Numbers are numpy arrays: of shape (rows,), or (rows, 3) for vectors. Texts are lists of str.
    """

    def __init__(self, columns: Mapping[str, Column], title: str = "") -> None:
        super().__init__(columns)
        self.title = title

    def __reduce__(self) -> tuple[Any, ...]:
        return Table, (*super().__reduce__()[1], self.title)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.values()))) if self else 0

    def row(self, index: int) -> dict[str, Any]:
        """One row by column name."""
        return {name: column[index] for name, column in self.items()}

    def each(self) -> Iterator[dict[str, Any]]:
        """All rows in turn."""
        return (self.row(index) for index in range(self.rows))

    def to_pandas(self) -> "pandas.DataFrame":
        """As a frame of pandas, with the units in ``frame.attrs["units"]``; vectors become columns ``.x``, ``.y``,
        ``.z``, quaternions also ``.w``. Needs pandas."""
        import pandas

        flat: dict[str, Any] = {}
        units: dict[str, str] = {}
        for name, column in self.items():
            axes = AXES[column.shape[1]] if isinstance(column, np.ndarray) and column.ndim == 2 else ""
            for k, axis in enumerate(axes):
                flat[f"{name}.{axis}"] = column[:, k]
                units[f"{name}.{axis}"] = self.units.get(name, "")
            if not axes:
                flat[name] = column
                units[name] = self.units.get(name, "")
        frame = pandas.DataFrame(flat)
        frame.attrs["units"] = units
        return frame

    def shown(self) -> Any:
        """`to_pandas` where pandas is installed; else this table."""
        try:
            return self.to_pandas()
        except ImportError:
            return self

    def _cells(self) -> list[list[str]]:
        return [[text_of(value) for value in self.row(index).values()] for index in range(min(self.rows, MOST_ROWS))]

    def _head(self) -> list[str]:
        return [self.with_unit(name) for name in self]

    def __repr__(self) -> str:
        lines = [self._head(), *self._cells()]
        widths = [max(len(line[k]) for line in lines) for k in range(len(self))]
        out = [self.title] if self.title else []
        out += ["  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines]
        if self.rows > MOST_ROWS:
            out.append(f"... {self.rows} rows")
        return "\n".join(out)

    def _repr_html_(self) -> str:
        def line(cells: Sequence[str], tag: str) -> str:
            return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

        rows = "".join(line(cells, "td") for cells in self._cells())
        more = f"<caption>{html.escape(self.title)}</caption>" if self.title else ""
        end = f"<p>... {self.rows} rows</p>" if self.rows > MOST_ROWS else ""
        return f"<table>{more}{line(self._head(), 'th')}{rows}</table>{end}"


def rows_table(names: Sequence[str], rows: Sequence[Sequence[Any]], title: str = "") -> Table:
    """A table of rows. A column of numbers becomes an array, in which None is nan."""
    columns: dict[str, Column] = {}
    for k, name in enumerate(names):
        values = [row[k] for row in rows]
        numbers = all(value is None or isinstance(value, (int, float)) for value in values)
        columns[name] = np.array(values, dtype=float) if numbers and values else values
    return Table(columns, title)
