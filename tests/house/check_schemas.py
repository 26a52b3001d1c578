"""Every shipped YAML file is of its schema, and what the schema refuses the reader refuses, too.

usage: check_schemas.py HANDSIM
"""
import copy
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import jsonschema
import yaml

ROOT = Path(__file__).resolve().parents[2]
# As `handsim check` calls the kinds of file that have a schema.
KINDS = {"a scene": "scene", "a person": "person", "a hand model": "hand", "a controller": "controller",
         "a pose file": "poses", "an object": "object", "a material": "material",
         "an anthropometry file": "anthropometry", "a table of grip strength": "grip_norms",
         "a table of what accuracy costs": "costs", "a rollout study": "rollouts",
         "muscles of a hand": "muscles", "a table of measurements": "measurements",
         "names of a motion file": "names"}
# Other studies, and where markers and points lie, have no schema.
OTHERS = {"an accuracy study", "a stability study", "a marker set"}


def kinds_of(handsim, paths):
    """What `handsim check` takes each file for."""
    done = subprocess.run([handsim, "check", *paths], capture_output=True, text=True)
    named = {}
    for line in done.stdout.splitlines():
        path, _, kind = line.removesuffix(", good").rpartition(": ")
        named[path] = kind
    return named


def mutants(content):
    """A key that is misspelt, and a value of another type, at the top and one level down."""
    key = next(iter(content))
    yield {**content, "no_such_key": 1}
    yield {**{k: v for k, v in content.items() if k != key}, key + "x": content[key]}
    yield {**content, key: [[[]]]}
    for name, inner in content.items():
        if isinstance(inner, list) and inner and isinstance(inner[0], dict):
            changed = copy.deepcopy(content)
            changed[name][0]["no_such_key"] = 1
            yield changed
            break


def refused(handsim, kind, content, folder):
    path = folder / "changed.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False))
    return subprocess.run([handsim, "check", path], capture_output=True).returncode == 2


def main(handsim):
    problems = []
    schemas = {}
    for word in KINDS.values():
        text = subprocess.run([handsim, "schema", word], capture_output=True, text=True, check=True).stdout
        jsonschema.Draft202012Validator.check_schema(json.loads(text))
        schemas[word] = jsonschema.Draft202012Validator(json.loads(text))
    paths = [str(path) for folder in ("config", "handmodels", "controllers")
             for path in sorted((ROOT / folder).rglob("*.yaml"))
             if path.parent.name != "goals" and path.name != "grasp_types.yaml"]  # read by the Python package
    named = kinds_of(handsim, paths)
    seen = set()
    for path in paths:
        kind = named.get(path)
        if kind in OTHERS:
            continue
        if kind not in KINDS:
            problems.append(f"{path}: handsim check says {kind}")
            continue
        content = yaml.safe_load(Path(path).read_text())
        for error in schemas[KINDS[kind]].iter_errors(content):
            problems.append(f"{path}: {list(error.absolute_path)}: {error.message[:200]}")
        if kind in seen:
            continue
        # The first file of each kind, changed.
        seen.add(kind)
        with tempfile.TemporaryDirectory() as folder:
            for number, changed in enumerate(mutants(content)):
                if not list(schemas[KINDS[kind]].iter_errors(changed)):
                    problems.append(f"{path}: the schema takes change {number}")
                if not refused(handsim, kind, changed, Path(folder)):
                    problems.append(f"{path}: the reader takes change {number}")
    problems += [f"no shipped file is {kind}" for kind in KINDS if kind not in seen]
    print("\n".join(problems) or f"{len(paths)} files are as their schemas say")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
