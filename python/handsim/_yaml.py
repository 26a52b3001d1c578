"""YAML files of commands in Python: numbers with units, and all problems at once with their places. Needs PyYAML."""
from __future__ import annotations

import difflib
import math
from pathlib import Path
from typing import Any, Optional, Sequence

from . import _core
from ._errors import Error, Problem, input_error

DEEPEST, MOST_PLACES = 50, 100_000
"""Of a file: levels and values, with those of its aliases."""


def number_of(value: Any) -> Optional[float]:
    """SI of 0.2, ``"5 mm"``; None for anything else."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    try:
        return _core.parse_quantity(value.strip()) if isinstance(value, str) else float(value)
    except OverflowError:
        return None


def parser() -> Any:
    try:
        import yaml
    except ImportError:
        raise input_error("PyYAML", "no Python module of this name", "it, for this command: pip install pyyaml") from None
    return yaml


class Document:
    """A file's content by dotted keys. What is wrong is collected; `finish` raises it."""

    def __init__(self, path: Path) -> None:
        self.path, self.problems = path, list[Problem]()
        self.places: dict[str, tuple[int, int]] = {}
        yaml = parser()
        self.data: Any = None
        if not path.is_file():
            raise input_error(str(path), "no regular file" if path.exists() else "no file of this name", "a file that can be read")
        try:
            text = path.read_text(encoding="utf-8-sig")
            self._note(yaml.compose(text, Loader=yaml.SafeLoader), "", [])
            if not self.problems:
                self.data = yaml.safe_load(text)
        except (OSError, UnicodeDecodeError) as error:
            raise input_error(str(path), str(error), "a file that can be read") from None
        except yaml.YAMLError as error:
            mark = getattr(error, "problem_mark", None)
            self.problems = [Problem(str(path), mark.line + 1 if mark else 1, mark.column + 1 if mark else 1, "yaml",
                                     str(getattr(error, "problem", error)), "YAML")]
        except RecursionError:
            self.problems = [Problem(str(path), 1, 1, "yaml", "lists within lists within lists", f"at most {DEEPEST} levels")]
        except (ValueError, TypeError, OverflowError) as error:  # of a value that looks like a date
            self.problems = [Problem(str(path), 1, 1, "yaml", str(error), "numbers, texts, lists and mappings")]
        self.finish()

    def _note(self, node: Any, key: str, within: list[Any]) -> None:
        """Places of all keys; an alias has those of its anchor."""
        if node is None or self.problems:
            return
        at = node.start_mark.line + 1, node.start_mark.column + 1
        self.places[key] = at
        wrong = ("an alias of itself" if any(node is each for each in within) else "lists within lists within lists" if len(within) > DEEPEST
                 else "aliases of aliases" if len(self.places) > MOST_PLACES else "")
        if wrong:
            self.problems.append(Problem(str(self.path), *at, key[:80] or "file", wrong, f"at most {DEEPEST} levels and {MOST_PLACES} values"))
            return
        pairs = ([(str(name.value), child) for name, child in node.value] if node.id == "mapping" else
                 [(str(i), child) for i, child in enumerate(node.value)] if node.id == "sequence" else [])
        for name, child in pairs:
            self._note(child, f"{key}.{name}" if key else name, [*within, node])

    def get(self, key: str, default: Any = None) -> Any:
        found = self.data
        for word in key.split(".") if key else []:
            if isinstance(found, dict) and word in found:
                found = found[word]
            elif isinstance(found, list) and word.isdigit() and int(word) < len(found):
                found = found[int(word)]
            else:
                return default
        return found

    def wrong(self, key: str, got: object, need: str) -> None:
        at = key
        while at and at not in self.places:
            at = at.rpartition(".")[0]
        self.problems.append(Problem(str(self.path), *self.places.get(at, (1, 1)), key, str(got), need))

    def real(self, key: str, default: Optional[float], low: float = -math.inf, high: float = math.inf) -> float:
        """A number in its range; without a default it is required."""
        value = self.get(key)
        if value is None and default is not None:
            return default
        found = number_of(value)
        if found is None or not math.isfinite(found) or not low <= found <= high:
            limits = "" if low == -math.inf else f" from {low:g}" if high == math.inf else f" of {low:g} to {high:g}"
            self.wrong(key, "nothing" if value is None else repr(value), f"a number{limits}")
            return low if math.isfinite(low) else 0.0
        return found

    def reals(self, key: str, count: int, free: bool = False) -> list[float]:
        """With ``free``, ~ is NaN."""
        value = self.get(key)
        if not isinstance(value, list) or len(value) != count:
            self.wrong(key, "nothing" if value is None else repr(value), f"a list of {count} numbers" + (", ~ where it is free" if free else ""))
            return [0.0] * count
        return [math.nan if free and value[i] is None else self.real(f"{key}.{i}", None) for i in range(count)]

    def choice(self, key: str, known: Sequence[str], default: Optional[str] = None) -> str:
        value = self.get(key, default)
        if not isinstance(value, str) or value not in known:
            near = difflib.get_close_matches(str(value), known, 1)
            self.wrong(key, "nothing" if value is None else repr(value), (f"{near[0]}, or another of " if near else "one of ") + _few(known))
            return known[0] if known else ""
        return str(value)

    def keys(self, key: str, known: Sequence[str]) -> None:
        """Only these keys, in a mapping."""
        found = self.get(key)
        if not isinstance(found, dict):
            self.wrong(key or "file", repr(found)[:60], "a mapping with some of " + ", ".join(known))
            return
        for name in found:
            if name not in known:
                near = difflib.get_close_matches(str(name), known, 1)
                self.wrong(f"{key}.{name}" if key else str(name), "an unknown key", near[0] if near else "one of " + ", ".join(known))

    def finish(self) -> None:
        if self.problems:
            raise Error("\n".join(f"{p.file}:{p.line}:{p.column}: {p.key}: got {p.got}, need {p.need}" for p in self.problems), "input",
                        self.problems)


def _few(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f", ... ({len(names)})" if len(names) > 8 else "")


def scene_number(resolved: str, key: str) -> Optional[float]:
    """A number of a resolved scene by its dotted key."""
    found: Any = parser().safe_load(resolved)
    for word in key.split("."):
        if isinstance(found, dict):
            found = found.get(word)
        elif isinstance(found, list) and word.isdigit() and int(word) < len(found):
            found = found[int(word)]
        else:
            return None
    return number_of(found)
