"""The code of docs/python.md, docs/gradients.md, docs/optimise.md and README runs as printed."""
import importlib.util
import re

import pytest
from conftest import ROOT

BLOCK = re.compile(r"(?:^<!-- needs: (\w+) -->\n)?^```python\n(.*?)^```", re.S | re.M)


def blocks():
    for name in ("docs/python.md", "docs/gradients.md", "docs/optimise.md", "README.md"):
        text = (ROOT / name).read_text()
        for block in BLOCK.finditer(text):
            line = text.count("\n", 0, block.start(2)) + 1
            yield pytest.param(block.group(2), block.group(1), id=f"{name}:{line}")


@pytest.mark.parametrize("code, needs", list(blocks()))
def test_a_block_runs_as_printed(code, needs, tmp_path, monkeypatch):
    if needs and importlib.util.find_spec(needs) is None:
        pytest.skip(f"{needs} is not installed (pip install {needs})")
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "block", "exec"), {"__name__": "block"})
