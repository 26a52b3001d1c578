"""The example that sends a webcam's hands, with a rendered film in place of the camera."""
from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import handsim as hs
from handsim._live.streams import points_of
from handsim._live.tracker import HandFilter

EXAMPLE = Path(__file__).parents[2] / "python/examples/send_webcam.py"
SECONDS = 9.0


def heard(film):
    """The frames that the example sends of a film."""
    out = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as to:
        to.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        to.bind(("127.0.0.1", 0))
        to.settimeout(1)
        example = subprocess.Popen([sys.executable, str(EXAMPLE), str(to.getsockname()[1]), str(film)], stderr=subprocess.DEVNULL, env=os.environ)
        while True:
            try:
                out.append(json.loads(to.recv(1 << 16)))
            except socket.timeout:
                if example.poll() is not None:
                    break
    assert example.returncode == 0
    return out


@pytest.mark.skipif(not hs.has_pictures or not shutil.which("ffmpeg"), reason="needs pictures and ffmpeg")
def test_rendered_hands_are_seen_on_their_sides_and_bend_as_they_do(tmp_path):
    pytest.importorskip("cv2", reason="opencv-python is not installed")
    if not hasattr(pytest.importorskip("mediapipe", reason="mediapipe is not installed (pip install mediapipe==0.10.14)"), "solutions"):
        pytest.skip("this mediapipe has no solutions: pip install mediapipe==0.10.14")
    scene = hs.load("every_pose", engine="articulated")
    scene.video(tmp_path / "hands.mp4", SECONDS, fps=15, size=(960, 720), view="dorsal")
    frames = heard(tmp_path / "hands.mp4")
    assert len(frames) > 0.9 * 15 * SECONDS
    assert sum(set(each["hands"]) == {"right", "left"} for each in frames) > 0.9 * len(frames)
    run, times, angles = hs.Simulation(scene), [], []
    while run.time < SECONDS:
        times.append(run.time)
        angles.append(np.array(run.q))
        run.step(substeps=round(1 / 30 / scene.step))
    for hand, side in enumerate(scene.hands):
        noise, seen, true = {}, [], []
        for mirrored in (False, True):
            filter_ = HandFilter(scene, hand)
            fingers = [i for i, axis in enumerate(filter_.axes) if axis.endswith("flexion") and "thumb" not in axis]
            for each in frames:
                if side not in each["hands"]:
                    continue
                x, y, z = points_of(each["hands"][side]["joints"]).T
                filter_.update(np.stack((-x if mirrored else x, -z, y), axis=1), each["t"])
                if not mirrored:
                    seen.append(filter_.pose[7:][fingers].mean())
                    true.append(np.mean([np.interp(each["t"], times, np.array(angles)[:, scene.coordinates.index(filter_.axes[i])]) for i in fingers]))
            filter_.finish()
            noise[mirrored] = filter_.noise
        # Fingers of a fist are hidden from behind: their angles are guessed by MediaPipe, their mean is nearly right.
        assert np.corrcoef(seen, true)[0, 1] > 0.85
        assert noise[False] < noise[True]  # the hand's shape is that of its side
