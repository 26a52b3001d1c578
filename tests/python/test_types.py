"""Types: mypy finds nothing in the package, and the stubs are those of the module."""
import subprocess
import sys

import pytest
from conftest import ROOT

pytest.importorskip("mypy", reason="mypy is not installed")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Calls a module of mypy; what one call has read of other packages, the next one need not read."""
    cache = tmp_path_factory.mktemp("mypy")

    def run(*words):
        done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, cwd=ROOT,
                              env={"PATH": "/usr/bin:/bin", "MYPY_CACHE_DIR": str(cache), "PYTHONPATH": ":".join(sys.path)})
        assert done.returncode == 0, done.stdout + done.stderr

    return run


def test_mypy_strict_is_clean(run):
    run("mypy", "--strict")


def test_the_stubs_are_those_of_the_module(run):
    run("mypy.stubtest", "handsim._core", "--allowlist", "tests/python/stubtest_allowlist.txt", "--ignore-unused-allowlist")
