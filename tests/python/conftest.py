"""Scenes that several tests use."""
import signal
import sys
from pathlib import Path

import pytest

import handsim as hs

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(Path(__file__).parent))
# A parent that ignores Ctrl-C hands that on, and tests that send it would wait for ever.
signal.signal(signal.SIGINT, signal.default_int_handler)

# A ball on a plane and one above it.
BALLS = {
    "title": "balls", "ground": {"height": 0}, "duration": "0.5 s",
    "objects": [{"name": "low", "shape": "sphere", "radius": "30 mm", "mass": "100 g", "position": [0, 0, 0.03]},
                {"name": "high", "shape": "sphere", "radius": "30 mm", "mass": "200 g", "position": [0.2, 0, 9]}],
    "effects": ["gravity", "ground_contact", "friction"],
    "solver": {"engine": "articulated", "step": "1 ms"}}


@pytest.fixture(scope="session")
def two_hands():
    return hs.load("two_hands", engine="articulated")


@pytest.fixture(scope="session")
def can():
    return hs.load("grasp_power_can", engine="articulated")


@pytest.fixture(scope="session")
def balls():
    return hs.load(BALLS)
