#!/usr/bin/env python3
"""Compiles each file of src/ alone, without writing code: an include that a unity build hides is found.

Argument: a build folder of a preset without unity builds (CMake's preset `work`), configured with precompiled headers.
"""
import json
import os
import re
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path


def main(build: Path) -> int:
    source = Path(__file__).resolve().parents[1]
    targets = ["handsim_headers", "handsim_headers_fast", "handsim_headers_light", "handsim_version"]
    known = subprocess.run(["ninja", "-C", build, "-t", "targets", "all"], capture_output=True, text=True, check=True).stdout
    names = set(re.findall(r"^(\S+): phony", known, re.M))
    subprocess.run(["ninja", "-C", build, *(t for t in targets if t in names)], check=True, stdout=subprocess.DEVNULL)
    entries = [e for e in json.loads((build / "compile_commands.json").read_text())
               if Path(e["file"]).is_relative_to(source)]
    # A file of two targets is compiled once.
    entries = list({e["file"]: e for e in entries}.values())

    def compile_alone(entry: dict) -> bool:
        words = shlex.split(entry["command"])
        words = words[1:] if Path(words[0]).name == "ccache" else words
        out = words.index("-o")
        words = words[:out] + words[out + 2:] + ["-fsyntax-only"]
        done = subprocess.run(words, cwd=entry["directory"], capture_output=True, text=True)
        sys.stderr.write(done.stderr)
        return done.returncode == 0

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        good = list(pool.map(compile_alone, entries))
    print(f"{len(good)} files of src/ compiled alone, {good.count(False)} of them failed")
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).resolve()))
