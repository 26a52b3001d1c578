"""No module of the package imports itself by way of others: imports within functions and for types count, too."""
import ast
from graphlib import CycleError, TopologicalSorter

import pytest
from conftest import ROOT

PACKAGE = ROOT / "python" / "handsim"


def modules(package):
    """Path by name of each module; a package is its __init__."""
    return {".".join((package.name, *path.relative_to(package).with_suffix("").parts)).removesuffix(".__init__"): path
            for path in package.rglob("*.py")}


def imported(name, path, known):
    """The modules among `known` that a module names in an import, wherever it stands."""
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names if each.name in known)
        elif isinstance(node, ast.ImportFrom):
            start = package.split(".")[:len(package.split(".")) - node.level + 1] if node.level else []
            of = ".".join([*start, *(node.module or "").split(".")]).rstrip(".")
            for each in node.names:
                # _core is the C++ module, which needs nothing of the package's __init__.
                whole = f"{of}.{each.name}"
                if whole in known or of in known and each.name != "_core":
                    yield whole if whole in known else of


def circle(package):
    """Names along a circle of imports; empty without one."""
    known = modules(package)
    assert len(known) > 1
    try:
        TopologicalSorter({name: set(imported(name, path, known)) for name, path in known.items()}).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_module_imports_itself_by_way_of_others():
    assert circle(PACKAGE) == []


@pytest.mark.parametrize("line", ["from .b import c", "from . import b", "def f():\n    from pack import b", "import pack.b",
                                  "if TYPE_CHECKING:\n    from .b import c"])
def test_a_circle_is_found_in_every_form_of_import(tmp_path, line):
    folder = tmp_path / "pack"
    folder.mkdir()
    for name, text in (("__init__", ""), ("a", line), ("b", "from .a import f")):
        (folder / f"{name}.py").write_text(text)
    assert set(circle(folder)) == {"pack.a", "pack.b"}
