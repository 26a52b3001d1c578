"""Changed hand models, persons, controllers, poses and command lines, given to the program.

usage: mutate.py HANDSIM [COUNT] [SEED]

Each of COUNT inputs is a shipped file with one to four changes, or a command line with wrong words. Fails for an exit status
other than 0, 1 or 2, more than 10 s of CPU time, more than 1 GB, a message without a place or a key, words of the source in a
message, and numbers that are not finite in a table. The failing input stays in the folder that is printed.
"""
import os
import random
import re
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SECONDS, BYTES = 10, 1 << 30
NUMBERS = ["0", "-1", "1e-9", "1e-320", "1e9", "1e308", "1e999", ".nan", "-.inf", "1,5", "0x10", "1e", "175", "0.5 HL", "2 HL",
           "-2 HB", '"1e-9 HB"', '"5 mm"', '"5 kg"', '"90 deg"', "true", "~", "[]", "{}", "[1, 2]", "{a: 1}", "''", "word",
           '"' + " + ".join(["1e-7 HL"] * 3000) + '"', "!!float 1", "*x", "&x 1", "9" * 400]
WORDS = ["palm", "nope", "thumb", "index_mcp", "all", "*", "a*b*c", "", "ü", "x" * 70, "../up", "world", ".", "hinge", "fixed", "ball",
         "universal", "index_mcp.flexion", "body_mass_share", "density", "explicit", "implicit"]
KEYS = ["diameter", "weight", "height", "name", "joints", "segments", "parent", "at", "length", "radius", "counts_as", "based_on",
        "of_palm", "mass_share", "forearm", "muscles", "stop", "shapes", "torque_limit", "like", "keys", "bones", "<<", "0", "a.b"]
INTERNAL = re.compile(r"zero_pose|first_dof|child_frame|parent_frame|contact_rules|std::|terminate|[Aa]ssert|0x[0-9a-f]{7}|YAML::|Eigen|"
                      r"nullptr|basic_string|vector::|map::at|stod|bad_alloc|out_of_range|kPalm|\(null\)|\boptional\b|handsim::")
PLACE, PROBLEM = re.compile(r"\S+:\d+:\d+: "), re.compile(r".*\bgot .*, need .*")
# Of the library that reads command lines.
USAGE = re.compile(r"Run with --help|.* is required$|.* requires .*|.* excludes .*|.*: \d+ required .* missing$|.* not convert: .*|--[\w-]+: At Most 1 required .*")


def numbers(text):
    return list(re.finditer(r"(?<=[\s\[,{])-?\d[\d.e-]*(?: [A-Z]{2})?(?=[\s\],}])", text))


def change(text, rng):
    lines = text.split("\n")
    at = rng.randrange(len(lines))
    kind = rng.choice([0] * 8 + [3] * 3 + [4] * 3 + [7] * 3 + [5, 6, 8, 9, 10])
    if kind == 0 and (found := numbers(text)):
        one = rng.choice(found)
        return text[:one.start()] + rng.choice(NUMBERS) + text[one.end():]
    if kind == 3 and (found := list(re.finditer(r"(?<=: )[a-z_]+(?=[\s,}\]])", text))):
        one = rng.choice(found)
        return text[:one.start()] + rng.choice(WORDS) + text[one.end():]
    if kind == 4 and (found := list(re.finditer(r"\b[a-z_]+(?=: )", text))):
        one = rng.choice(found)
        return text[:one.start()] + rng.choice(KEYS) + text[one.end():]
    if kind == 5:
        del lines[at:at + rng.randint(1, 8)]
    elif kind == 6:
        lines[at:at] = lines[at:at + rng.randint(1, 6)]
    elif kind == 7:
        indent = re.match(r" *(?:- )?", lines[at]).group(0).replace("-", " ")
        lines.insert(at, f"{indent}{rng.choice(KEYS)}: {rng.choice(NUMBERS)}")
    elif kind == 8:
        return text[:rng.randrange(len(text))]
    elif kind == 9:
        where = rng.randrange(len(text))
        return text[:where] + rng.choice(["\t", "\x00", '"', "'", "]", "}", "[" * 80, ": ", "- ", "#", "\n", "%", "|", "\\", "{"]) + text[where:]
    else:
        other = rng.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    return "\n".join(lines)


def sources():
    folders = {"hand": [ROOT / "handmodels" / f"{n}.yaml" for n in ("anatomical", "prototype", "forearm", "muscles", "anthropometry")],
               "person": sorted((ROOT / "config/persons").glob("*.yaml")),
               "controller": [ROOT / "controllers" / f"{n}.yaml" for n in ("implicit", "explicit", "grasp", "prototype")],
               "poses": [ROOT / "controllers" / f"{n}.yaml" for n in ("poses", "two_hands_poses")]}
    return [(kind, path, path.read_text()) for kind, paths in folders.items() for path in paths]


def scene(folder, kind, path):
    """A scene in which the changed file stands, so that it is also built."""
    names = {"model": ROOT / "handmodels/anatomical.yaml", "person": ROOT / "config/persons/median_man.yaml",
             "controller": ROOT / "controllers/implicit.yaml", "poses": ROOT / "controllers/poses.yaml"}
    names["model" if kind == "hand" else kind] = path
    out = folder / "scene.yaml"
    out.write_text("hands: [{model: %(model)s, person: %(person)s, side: right, wrist: {mount: hinge}}]\n"
                   "control: {controller: %(controller)s, poses: %(poses)s, program: every_pose}\n"
                   "effects: [gravity, joint_stops, passive_tissue, actuation]\nduration: 0.01\n" % names)
    return out


def file_case(rng, folder, files, package):
    kind, path, text = rng.choice(files)
    for _ in range(rng.randint(1, 4)):
        text = change(text, rng) or text
    # Beside the shipped files, which it may name.
    changed = folder / path.name
    changed.write_bytes(text.encode("utf-8", "surrogateescape"))
    for name in ("anthropometry", "anatomical", "muscles", "grip_strength"):
        if not (folder / f"{name}.yaml").exists():
            (folder / f"{name}.yaml").symlink_to(ROOT / f"handmodels/{name}.yaml")
    way = rng.randrange(3)
    if way == 0 or path.name in ("muscles.yaml", "anthropometry.yaml"):
        return ["check", str(changed)]
    if way == 1 and kind in ("hand", "person") and package:
        person = ["--person", str(changed)] if kind == "person" else ["--stature", "1.7", "--mass", "70", "--sex", "male"]
        return ["hand", *person, *(["--model", str(changed)] if kind == "hand" else []), "--side", "right"]
    return ["check", str(scene(folder, kind, changed))]


def option_case(rng, commands):
    values = NUMBERS[:30] + WORDS + ["two_hands", "two_hnds", "persons/child", "nope.yaml", "/", "/dev/null", "solver.step=1", "a=b=c", "=", "a.b.c.d=1",
                                     "hands.0.person.stature=175", "objects.9.mass=1", "solver.engine=[ode]", "1/2", "5 mm", "-5"]
    command = rng.choice(list(commands))
    words = [command]
    for _ in range(rng.randint(0, 4)):
        option = rng.choice(commands[command] + ["--nope", "-x", "--", ""])
        words += [option] if rng.random() < 0.3 else [option, rng.choice(values)]
    if rng.random() < 0.5:
        words.insert(rng.randrange(1, len(words) + 1), rng.choice(values))
    return [word.replace("\x00", "") for word in words]


def run(handsim, words, folder):
    """Exit status, output, errors, what is wrong with the run."""
    def limit():
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    with open(folder / "out", "wb") as out, open(folder / "err", "wb") as err:
        child = subprocess.Popen([handsim, *words], stdout=out, stderr=err, stdin=subprocess.DEVNULL, cwd=folder, preexec_fn=limit)
        _, status, used = os.wait4(child.pid, 0)
    child.returncode = code = os.waitstatus_to_exitcode(status)
    out, err = ((folder / name).read_bytes().decode("utf-8", "replace") for name in ("out", "err"))
    wrong = []
    if code not in (0, 1, 2):
        wrong.append(f"exit status {code}")
    if used.ru_maxrss * 1024 > BYTES:
        wrong.append(f"{used.ru_maxrss >> 10} MB")
    if used.ru_utime + used.ru_stime > SECONDS:
        wrong.append("more than 10 s")
    return code, out, err, wrong


def judge(words, from_file, code, out, err):
    wrong = []
    if INTERNAL.search(err):
        wrong.append("words of the source: " + INTERNAL.search(err).group(0))
    if code == 2 and not err.strip():
        wrong.append("no message")
    if code == 1 and words[0] in ("check", "hand"):
        wrong.append("exit status 1")
    if words[0] == "hand" and code == 0 and re.search(r"\b-?(nan|inf)\b", out):
        wrong.append("not finite")
    for line in err.splitlines():
        if line.startswith(("warning: ", "note: ", "handsim: out of memory")) or re.match(r"and \d+ more", line):
            continue
        found = PROBLEM.match(line)
        if not found and not USAGE.match(line) and code == 2:
            wrong.append("no `got X, need Y`: " + line[:200])
        elif found and from_file and not PLACE.match(line):
            wrong.append("no place: " + line[:200])
    return wrong


def options_of(handsim):
    """Commands that end by themselves, with their options."""
    out = {}
    for command in ("hand", "check", "render", "export", "schema", "effects", "accuracy", "stability", "inverse", "track", "validate", "report", "completion", "grasp",
                    "rollouts", "nope"):
        text = subprocess.run([handsim, command, "--help"], capture_output=True, text=True).stdout
        out[command] = sorted(set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)) - {"--help"}) or ["--out"]
    return out


def main(handsim, count=300, seed=1):
    handsim, rng = str(Path(handsim).resolve()), random.Random(int(seed))
    files, commands = sources(), options_of(handsim)
    failed, statuses = [], {}
    keep = Path(tempfile.mkdtemp(prefix="mutate-"))
    for number in range(int(count)):
        folder = keep / str(number)
        folder.mkdir()
        by_file = rng.random() < 0.75
        words = file_case(rng, folder, files, "--stature" in commands["hand"]) if by_file else option_case(rng, commands)
        # A command line that is right would run a study: what it writes goes beside the input.
        code, out, err, wrong = run(handsim, words, folder)
        statuses[code] = statuses.get(code, 0) + 1
        if by_file or code == 2:
            wrong += judge(words, by_file and words[0] == "check", code, out, err)
        if wrong:
            failed.append((folder, words, wrong))
        else:
            subprocess.run(["rm", "-rf", str(folder)])
    for folder, words, wrong in failed:
        print(f"{folder}: {' '.join(word[:80] for word in words)}\n  " + "\n  ".join(wrong[:3]))
    if not failed:
        keep.rmdir()
    print(f"{count} inputs, exit statuses {dict(sorted(statuses.items()))}, {len(failed)} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
