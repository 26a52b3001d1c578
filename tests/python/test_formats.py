"""One table of output formats: what the pages, the command and the package say of them is its content."""
import os
import re
import subprocess
import sys

import pytest
from conftest import ROOT
from handsim._formats import FORMATS

import handsim as hs


def test_each_format_has_one_writer(two_hands):
    for name, of in FORMATS.items():
        assert callable(of.write)
        if of.of_model:
            assert of.mark.decode() in two_hands.to_format(name)
    with pytest.raises(hs.Error, match="format: got glb, need one of mjcf, urdf, osim"):
        two_hands.to_format("glb")


def test_the_page_has_the_table():
    text = (ROOT / "docs" / "export.md").read_text(encoding="utf-8").partition("<!-- table: formats -->\n")[2].partition("<!-- end -->")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in text.splitlines()[2:]]
    assert [row[0].strip("`") for row in rows] == list(FORMATS)
    for row, of in zip(rows, FORMATS.values()):
        assert row[1:4] == [", ".join(f"`{ending}`" for ending in of.endings), of.text.replace("--time", "`--time`"), of.of]
        assert row[4] == (of.needs and f"`{of.needs}`")


@pytest.mark.parametrize("start", [[os.environ.get("HANDSIM_PROGRAM", str(ROOT / "build/release/src/handsim"))], [sys.executable, "-m", "handsim"]])
def test_a_misspelt_format_gets_the_names_of_all(start, tmp_path):
    done = subprocess.run([*start, "export", "two_hands", "--format", "glbb", "--out", str(tmp_path / "a")], capture_output=True, text=True)
    assert done.returncode == 2
    assert f"--format: got glbb, need one of {', '.join(FORMATS)} (nearest: glb)" in done.stderr


def test_places_where_a_format_is_added_exist_and_are_three():
    text = (ROOT / "docs" / "inside.md").read_text(encoding="utf-8").partition("**An output format**")[2].partition("\n\n")[0]
    named = {path for path in re.findall(r"`([\w/]+(?:\.\w+)?)`", text) if "/" in path}
    found = {path: next((each for each in (ROOT / path, ROOT / "src" / path, ROOT / "src" / "handsim" / path) if each.exists()), None)
             for path in named}
    assert None not in found.values() and len(found) == 3, found
    rows = found["python/handsim/_formats.py"].read_text(encoding="utf-8")
    assert all(f'Format("{name}"' in rows for name in FORMATS)
