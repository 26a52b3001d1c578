"""The page of a session: the report's own page of the scene, with the script of the live view in place of its last one."""
from __future__ import annotations

import html
import json
import re
import tempfile
from pathlib import Path
from typing import Any, Mapping

from .. import _core
from .._errors import input_error
from .course import Files

_DATA = re.compile(r'<script type="application/json" id="data">(.*?)</script>', re.S)
_SCRIPT = re.compile(r"<script>(.*?)</script>", re.S)
_STYLE = re.compile(r"<style>(.*?)</style>", re.S)


class Parts:
    """Script, style and scene of a page. :raises Error: of kind input in a build without three.js"""

    def __init__(self, files: Files, overrides: Mapping[str, Any]) -> None:
        if not _core.has_reports:
            raise input_error("live", "a build without three.js", "one with it: install libjs-three and build again")
        # Two steps of the scene have all that does not move: shapes, colours, camera.
        short = files.compile({**overrides, "duration": "2 ms", "solver.step": "1 ms", "record.every": "1 ms"})
        with tempfile.TemporaryDirectory() as folder:
            short.run(Path(folder) / "run", frames=0, report=True, progress=False)
            text = (Path(folder) / "run" / "report.html").read_text()
        data = _DATA.search(text)
        style = _STYLE.search(text)
        assert data is not None and style is not None
        run = json.loads(data[1])["runs"][0]
        self.style = style[1]
        self.scripts = _SCRIPT.findall(text)[:-1]
        contacts = run["contacts"]
        self.scene = {"scene": run["scene"], "title": run["title"], "names": contacts["names"] if contacts else []}
        self.shape_index = {each["name"]: i for i, each in enumerate(self.scene["names"])}


def page_text(parts: Parts, data: Mapping[str, Any]) -> str:
    """The page as one file. :param data: for the script, beside the scene"""
    live = (Path(__file__).parent / "live.js").read_text()
    style = parts.style + (Path(__file__).parent / "live.css").read_text()
    # In JSON a < is within a string.
    content = json.dumps({**parts.scene, **data}, allow_nan=False).replace("<", "\\u003c")
    scripts = "\n".join(f"<script>{each}</script>" for each in [*parts.scripts, live])
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>live: {html.escape(str(parts.scene["title"]))}</title>
<link rel="icon" href="data:,">
<style>
{style}</style>
</head>
<body>
<noscript><p>This page draws with JavaScript, which is off here.</p></noscript>
<script type="application/json" id="data">{content}</script>
{scripts}
</body>
</html>
"""
