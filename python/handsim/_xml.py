"""Text of the writers of XML: numbers with all digits, and what needs an escape."""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import Error, Problem


def number(x: float) -> str:
    return format(float(x), ".17g")


def numbers(v: ArrayLike) -> str:
    """With blanks between."""
    return " ".join(map(number, np.asarray(v, float).ravel().tolist()))


def attribute(text: str) -> str:
    """As the value of an attribute."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")


def element(tag: str, content: str | float) -> str:
    return f"<{tag}>{content if isinstance(content, str) else number(content)}</{tag}>"


def rotation_matrix(q: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rotation matrix of a quaternion w x y z."""
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def refuse(problems: list[tuple[str, str, str]]) -> None:
    """:raises Error: of kind input with all problems: a key, what it has, and what it needs"""
    if problems:
        raise Error("\n".join(f"{key}: got {got}, need {need}" for key, got, need in problems), "input",
                    [Problem(None, None, None, *each) for each in problems])
