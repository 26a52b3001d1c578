"""Tables: a dict of columns that shows itself."""
from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any, Iterator, Sequence, Union

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas

Column = Union[NDArray[Any], Sequence[Any]]
MOST_ROWS = 40


def text_of(value: object) -> str:
    if isinstance(value, (float, np.floating)):
        return "" if np.isnan(value) else f"{value:.4g}"
    if isinstance(value, np.ndarray):
        return ", ".join(text_of(each) for each in value.tolist())
    return "" if value is None else str(value)


class Table(dict[str, Any]):
    """Columns by name, all of one length; names carry units, e.g. ``length[m]``.

    Numbers are numpy arrays: of shape (rows,), or (rows, 3) for vectors. Texts are lists.
    """

    def __init__(self, columns: dict[str, Column], title: str = "") -> None:
        super().__init__(columns)
        self.title = title

    def __reduce__(self) -> tuple[Any, ...]:
        return Table, (dict(self), self.title)

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
        """As a frame of pandas; vectors become columns ``.x``, ``.y``, ``.z``. Needs pandas."""
        import pandas

        flat: dict[str, Any] = {}
        for name, column in self.items():
            if isinstance(column, np.ndarray) and column.ndim == 2:
                stem, bracket, unit = name.partition("[")
                for k, axis in enumerate("xyz"[: column.shape[1]]):
                    flat[f"{stem}.{axis}{bracket}{unit}"] = column[:, k]
            else:
                flat[name] = column
        return pandas.DataFrame(flat)

    def _cells(self) -> list[list[str]]:
        return [[text_of(value) for value in self.row(index).values()] for index in range(min(self.rows, MOST_ROWS))]

    def __repr__(self) -> str:
        lines = [list(self), *self._cells()]
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
        return f"<table>{more}{line(list(self), 'th')}{rows}</table>{end}"


def rows_table(names: Sequence[str], rows: Sequence[Sequence[Any]], title: str = "") -> Table:
    """A table of rows. A column of numbers becomes an array, in which None is nan."""
    columns: dict[str, Column] = {}
    for k, name in enumerate(names):
        values = [row[k] for row in rows]
        numbers = all(value is None or isinstance(value, (int, float)) for value in values)
        columns[name] = np.array(values, dtype=float) if numbers and values else values
    return Table(columns, title)
