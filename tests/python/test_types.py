"""Types: mypy finds nothing in the package, and the stubs are those of the module."""
import subprocess
import sys

import pytest
from conftest import ROOT

pytest.importorskip("mypy", reason="mypy is not installed")


def run(*words, tmp_path):
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, cwd=ROOT,
                          env={"PATH": "/usr/bin:/bin", "MYPY_CACHE_DIR": str(tmp_path), "PYTHONPATH": ":".join(sys.path)})
    assert done.returncode == 0, done.stdout + done.stderr


def test_mypy_strict_is_clean(tmp_path):
    run("mypy", "--strict", tmp_path=tmp_path)


def test_the_stubs_are_those_of_the_module(tmp_path):
    run("mypy.stubtest", "handsim._core", "--allowlist", "tests/python/stubtest_allowlist.txt",
        "--ignore-unused-allowlist", tmp_path=tmp_path)
