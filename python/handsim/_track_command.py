"""``handsim track RECORDING``: angles, wrists and the hand of a person from recorded hands."""
from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, Optional, Sequence

from . import _conventions, _core, _forces_command, _inverse
from ._errors import input_error
from ._files import ended, read_options, usage
from ._progress import bar
from ._shipped import find_file
from ._study_files import plot_note, print_files, warn, whole_option
from ._track import Asked, checked, choice, screen_text, summary_text
from ._windows import Work, opened

USAGE = """handsim track RECORDING [--out DIR]
       handsim track --convention-from RECORDING... --points NAME --out FILE

Inverse kinematics: joint angles and wrist poses of recorded hands, from 21 keypoints, markers or the sensors of a glove, and the measured
hand of the person (docs/motion.md). RECORDING is a file .csv, .json, .trc, or with ezc3d (pip install ezc3d) .c3d.

  --out DIR          out/RECORDING
  --person FILE      stature, mass and sex beside the measured hand; a file or a shipped name; the median man
  --model FILE       hand model file, or a shipped name; moving_thenar, the anatomical hand whose thumb carries its thenar pad
  --markers FILE     marker set, for markers and sensors; else 21 keypoints
  --points FILE      convention of the tracker, where its points lie; a file or a shipped name
  --up z|y           axis of the recording that points up; as the convention or a C3D file says in POINT:Y_SCREEN, else z
  --handedness SIDE  of the recording's axes, right or left; as the convention says, else right
  --keep-person      does not fit hand length, breadth and bones
  --activations      then inverse --muscles of the tracked motion, into the folder activations
  --no-smoothing     every frame for itself
  --noise LENGTH     for trials: normal noise of this standard deviation on every coordinate, such as "2 mm"
  --seed N           of the noise; 1
  --truth FILE       known joint angles (.mot, .csv), to compare with
  --json             prints summary.json in place of the table

Forces on an object that the recording has, too, in columns object.NAME.x[m] to .qz (docs/forces.md), into the folder forces:
  --object NAME=FILE an object file, a shipped object by its name, or a URDF of one link or two
  --support KIND     table, post or none: what the object rests on when it is not lifted; table
  --friction F       of skin on it, where it was measured; 0.8
  --mass MASS        of it, such as "350 g", in place of the file's; free: nobody knows it, forces are for each kilogram
  --muscles          shares forces by least muscle activation, and gives the activations
  --replay           simulates each lift with the object free, and says for how long the hands hold it; not of a table of more than 18000 frames
  --uncertain N      draws of what is uncertain, for bands of 5 to 95 %

Of a .c3d file alone:
  --names FILE       lines LABEL: NAME, the names of the file's labels in the marker set, or keypoints such as right.index_tip
In place of all these, where a tracker's points lie on the hand, from a recording of each of several people:
  --convention-from RECORDING...  fits the convention, a file; --help beside it says how

Example: handsim track keypoints.csv --out out/tracked
"""
FLAGS = ("--keep-person", "--activations", "--no-smoothing", "--json", "--muscles", "--replay")
VALUES = ("--out", "--person", "--model", "--markers", "--noise", "--seed", "--truth", "--names", "--up", "--points", "--handedness",
          "--object", "--support", "--friction", "--mass", "--uncertain")


def _length(text: Optional[str]) -> float:
    value = 0.0 if text is None else _core.parse_length(text)
    if value is None or not 0 <= value < 1:
        raise input_error("--noise", str(text), 'a length such as "2 mm", from 0 to below 1 m')
    return float(value)


def _asked(options: dict[str, Any]) -> Asked:
    def path(name: str, folder: Optional[str] = None) -> Optional[Path]:
        text = options.get(name)
        return None if text is None else Path(text) if folder is None else find_file(text, name, folder)

    recording, seed = Path(options["RECORDING"]), whole_option(options, "--seed", 0, 2**32 - 1)
    side = choice(options, "--handedness", ("left", "right"))
    return checked(Asked(recording, path("--person", "config/persons"), path("--model", "handmodels"), path("--markers"), path("--truth"),
                         "--keep-person" not in options, "--no-smoothing" not in options, _length(options.get("--noise")), 1 if seed is None else seed,
                         path("--names"), choice(options, "--up", ("y", "z")), path("--points", "handmodels/points"), None if side is None else side == "left"))


def _work(options: dict[str, Any]) -> int:
    asked = _asked(options)
    held = _forces_command.request(options, asked.recording)
    out = Path(options.get("--out") or Path("out") / asked.recording.stem)
    with opened(asked, held is not None and held.replay) as work:
        return _with_files(options, asked, held, out, work)


def _with_files(options: dict[str, Any], asked: Asked, held: Optional[_forces_command.Request], out: Path, work: Work) -> int:
    with bar(True, "track") as told:
        found, plotted = work.study(out, told)
    tracked = any(len(hand.tracked) for hand in found.hands)
    if not tracked:
        print("no frame of any hand is tracked: frames.csv says why of each", file=sys.stderr)
    if "--json" in options:
        print(summary_text(asked, found), end="")
        note, status = plot_note(plotted)
        if status:
            print(f"missing: plots{note}", file=sys.stderr)
    else:
        warn(found.warnings)
        print(screen_text(found), end="")
        status = print_files(out, plotted)
    if not tracked:
        return 1
    if held is not None:
        with bar(True, "forces") as told:
            text, drawn = work.forces(held, out, told)
        if "--json" not in options:
            print(text, end="")
            status = max(status, print_files(out / "forces", drawn))
    if "--activations" not in options:
        return status
    sys.stdout.flush()
    return max(status, _inverse.main([str(out / "scene.yaml"), "--muscles", "--apart", "--out", str(out / "activations")]))


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if "--convention-from" in arguments:
        return _conventions.main(arguments)
    if (status := usage(USAGE, arguments)) is not None:
        return status
    return ended(lambda: _work(read_options("track", arguments, "RECORDING", FLAGS, VALUES, ())))
