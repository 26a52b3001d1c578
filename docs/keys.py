"""Defaults and ranges in the tables of keys, from `handsim schema`, which has them from the reader.

A table of keys follows a line `<!-- keys: KIND PATH; ... -->`. The cells `default` and `range` of a row with one key are what
the schema has of it; where it has none they are written by hand, as all meanings are.
"""
import functools
import json
import math
import re
import subprocess

TABLE = re.compile(r"(<!-- keys: ([^>]*?) -->\n)((?:\|.*\n)+)")
# A smaller unit for small numbers.
SMALLER = {"m": ((1e-3, "mm"), (1e-6, "µm")), "s": ((1e-3, "ms"), (1e-6, "µs")), "kg": ((1e-3, "g"), (1e-6, "mg"))}


@functools.cache
def schema_of(handsim, kind):
    done = subprocess.run([handsim, "schema", kind], capture_output=True, text=True)
    return json.loads(done.stdout) if done.returncode == 0 else {}


def forms(schema, node):
    """The forms of a value: itself, those of a choice, and of the items of a list."""
    if "$ref" in node:
        node = schema["$defs"][node["$ref"].rpartition("/")[2]]
    yield node
    for each in node.get("anyOf", []):
        yield from forms(schema, each)
    for part in ("items", "additionalProperties"):
        if isinstance(node.get(part), dict):
            yield from forms(schema, node[part])


def form_of(schema, path):
    """What the schema has at a dotted path, or nothing."""
    nodes = [schema]
    for key in path:
        nodes = [form["properties"][key] for node in nodes for form in forms(schema, node) if key in form.get("properties", {})]
    return nodes[0] if nodes else {}


def number(x):
    power = math.floor(math.log10(abs(x)) + 1e-12) if x else 0
    short = number_text(x / 10**power)
    if len(short) < 3 and (power >= 4 or power <= -4):
        return f"{short}e{power}"
    return number_text(x)


def number_text(x):
    return f"{x:.12g}"


def split(x, unit):
    """A number in its unit or in a smaller one."""
    if x != 0 and abs(x) < 0.1:
        for scale, smaller in SMALLER.get(unit, ()):
            if abs(x) >= 0.1 * scale * (1 - 1e-9):
                return x / scale, smaller
    return x, unit


def quantity(x, unit):
    x, unit = split(x, unit)
    return f"{number(x)} {unit}".rstrip()


def unit_of(form):
    """The unit that the reader's own text of the key has."""
    found = re.search(r" to [-+.e0-9]+ ([^,]+?)(?:, such as.*)?$", form.get("description", ""))
    return found[1].replace("m3", "m³").replace("m2", "m²") if found else ""


def range_of(form):
    least, most, unit = form.get("minimum", form.get("exclusiveMinimum")), form.get("maximum"), unit_of(form)
    if least is None or most is None:
        return None
    if least == -most:
        return f"±{quantity(most, unit)}"
    (low, low_unit), (high, high_unit) = split(least, unit), split(most, unit)
    if low_unit != unit and most < 1:
        high, high_unit = most * low / least, low_unit
    ends = [number(low), "" if least == 0 or low_unit == high_unit else low_unit, "to", number(high), high_unit]
    return ("above " if "exclusiveMinimum" in form else "") + " ".join(filter(None, ends))


def default_of(form):
    value = form.get("default")
    if isinstance(value, bool):
        return str(value).lower()
    return quantity(value, unit_of(form)) if isinstance(value, (int, float)) else None


def with_number(cell, value):
    """A cell with a number of the schema, before what it says beyond it. A cell that begins with words stays."""
    first, comma, rest = cell.partition(", ")
    words = first and not re.match(r"above |[-±0-9]|(true|false)$", first)
    return cell if words or first.startswith(value + " ") else value + comma + rest


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def row(line, columns, marks, handsim):
    """A row with what the schema has of its key."""
    of = cells(line)
    keys = re.findall(r"`([^`]+)`", of[0])
    if len(keys) != 1 or of[0] != f"`{keys[0]}`" or not re.fullmatch(r"[\w.\[\]]+", keys[0]):
        return line
    form = {}
    for mark in marks:
        kind, _, path = mark.partition(" ")
        form = form or form_of(schema_of(handsim, kind), [*filter(None, path.split(".")), *keys[0].replace("[]", "").split(".")])
    if "anyOf" in form or form.get("type") in ("object", "array"):
        return line
    for name, value in (("default", default_of(form)), ("range", range_of(form))):
        if name in columns and value is not None and len(of) == len(columns):
            of[columns.index(name)] = with_number(of[columns.index(name)], value)
    return "| " + " | ".join(of).replace("|  |", "| |").replace("|  |", "| |") + " |\n"


def with_keys(text, handsim):
    """A page whose tables of keys say what the readers say."""
    def table(match):
        lines = match[3].splitlines(keepends=True)
        columns, marks = cells(lines[0]), [mark.strip() for mark in match[2].split(";")]
        if "default" not in columns and "range" not in columns:
            return match[0]
        return match[1] + "".join(lines[:2] + [row(line, columns, marks, handsim) for line in lines[2:]])
    return TABLE.sub(table, text)
