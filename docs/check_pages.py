"""Checks of README.md and docs/ without running a study: `./dev docs --check`.

Every table has a generator and every generator a table; every relative link, anchor and picture exists; every
picture in renders/ is on a page, and has its command there (renders.py); every command of a ```sh block uses commands,
options, files, tests and tasks of `./dev` that exist; every key of a reader (`handsim schema`) is on the page of its kind of file, with the reader's default and range (keys.py).
"""
import json
import re
import shlex
import subprocess
from pathlib import Path

import keys
import renders
import tables

ROOT = tables.ROOT
README_LINES = 250
# Pages with the keys of each kind of file.
KEY_PAGES = {"scene": ["scenes.md"], "person": ["persons.md"], "hand": ["persons.md", "scenes.md"],
             "controller": ["control.md"], "poses": ["control.md"], "object": ["scenes.md"],
             "material": ["scenes.md"], "rollouts": ["rollouts.md"], "names": ["motion.md"], "markers": ["motion.md"]}
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.S | re.M)


def place(page, text, at):
    return f"{page.relative_to(ROOT)}:{text.count(chr(10), 0, at) + 1}"


def without_code(text):
    """The text with blanks instead of blocks of code, so that positions do not change."""
    return FENCE.sub(lambda block: re.sub(r"[^\n]", " ", block.group(0)), text)


def anchors(page):
    """The anchors that GitHub makes from headings."""
    heads = re.findall(r"^#+ (.*)$", without_code(page.read_text()), re.M)
    return {re.sub(r"[^\w\- ]", "", re.sub(r"[`*]", "", head).lower()).replace(" ", "-") for head in heads}


def check_blocks(problems):
    found = set()
    for page in tables.PAGES:
        text = page.read_text()
        starts = len(re.findall(r"^<!-- (?:table|file): ", text, re.M))
        blocks = list(tables.BLOCK.finditer(text))
        if starts != len(blocks):
            problems.append(f"{page.relative_to(ROOT)}: a marked table without <!-- end -->")
        for block in blocks:
            kind, name, body = block.group(2), block.group(3), block.group(4)
            where = place(page, text, block.start())
            if kind == "file" and tables.copy_of(name) != body:
                problems.append(f"{where}: {name} differs from its copy: run ./dev docs")
            elif kind == "table" and name not in tables.TABLES:
                problems.append(f"{where}: no generator of table {name}")
            elif kind == "table" and body.count("\n") < 3:
                problems.append(f"{where}: table {name} is empty")
            if kind == "table":
                found.add(name)
    problems += [f"docs/tables.py: table {name} is on no page" for name in tables.TABLES if name not in found]


def check_links(problems):
    shown = set()
    for page in tables.PAGES:
        text = page.read_text()
        for link in LINK.finditer(without_code(text)):
            target, _, anchor = link.group(1).partition("#")
            if re.match(r"https?:", target):
                continue
            path = (page.parent / target).resolve() if target else page
            where = place(page, text, link.start())
            if not path.exists():
                problems.append(f"{where}: no {target}")
            elif anchor and path.suffix == ".md" and anchor not in anchors(path):
                problems.append(f"{where}: {target} has no heading #{anchor}")
            shown.add(path)
    problems += [f"{picture.relative_to(ROOT)}: on no page"
                 for picture in sorted((ROOT / "renders").iterdir()) if picture not in shown]


class Program:
    """Commands and options of handsim, from --help."""

    def __init__(self, path):
        self.path = path
        self.options = {}
        listed = self.help().partition("Subcommands:")[2]
        self.commands = set(re.findall(r"^  ([a-z]\w*) ", listed, re.M))

    def help(self, *command):
        done = subprocess.run([self.path, *command, "--help"], capture_output=True, text=True)
        return done.stdout if done.returncode == 0 else ""

    def options_of(self, *command):
        if command not in self.options:
            self.options[command] = set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", self.help(*command)))
        return self.options[command]


def check_handsim(words, program, problems, where):
    if not words or words[0] in ("--help", "--version"):
        return
    command = words[0]
    if command not in program.commands:
        problems.append(f"{where}: handsim has no command {command}")
        return
    # None: of a program that is not here, the Python package or the tests.
    options = program.options_of(*(("grasp", "plan") if words[:2] == ["grasp", "plan"] else (command,)))
    for word in words[1:]:
        option = word.split("=")[0]
        if options and word.startswith("-") and option not in {*options, "--help"}:
            problems.append(f"{where}: handsim {command} has no option {option}")
        if re.match(r"(config|handmodels|controllers|docs)(/|$)", word) and not list(ROOT.glob(word)):
            problems.append(f"{where}: no {word}")


def check_dev(words, problems, where):
    script = (ROOT / "dev").read_text()
    if words and not re.search(rf"^  {re.escape(words[0])}\)$", script, re.M):
        problems.append(f"{where}: ./dev has no {words[0]}")


def check_tests(words, problems, where, sources):
    for option, name in zip(words, words[1:]):
        if option == "-R" and not re.search(name, sources, re.M):
            problems.append(f"{where}: no test matches {name}")


def check_commands(program, problems):
    # A suite of GoogleTest is one test of ctest, FOLDER.SUITE.
    suites = re.compile(r"^TEST(?:_F|_P)?\((\w+),", re.M)
    sources = "\n".join(f"{path.relative_to(ROOT / 'tests').parts[0]}.{suite}" for path in (ROOT / "tests").rglob("*.cpp")
                        for suite in suites.findall(path.read_text()))
    sources += "\n" + "\n".join(path.read_text() for path in (ROOT / "tests").rglob("CMakeLists.txt"))
    sources += "\n" + "\n".join(f"python.{path.stem.removeprefix('test_')}" for path in (ROOT / "tests/python").glob("*.py"))
    for page in tables.PAGES:
        text = page.read_text()
        lines = []
        for block in FENCE.finditer(text):
            if block.group(1) == "sh":
                # Lines that end with a backslash continue the command; its position is that of its first line.
                for line in re.finditer(r"(?:[^\n]*\\\n)*[^\n]+", block.group(2)):
                    lines.append((block.start(2) + line.start(), line.group(0).replace("\\\n", " ")))
        for inline in re.finditer(r"`((?:handsim|ctest|\./dev) [^`]+)`", without_code(text)):
            lines.append((inline.start(), inline.group(1).replace("\n", " ")))
        for at, line in lines:
            where = place(page, text, at)
            try:
                words = shlex.split(line.removeprefix("$ "), comments=True)
            except ValueError as error:
                problems.append(f"{where}: {line}: {error}")
                continue
            while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
                words.pop(0)
            if not words:
                continue
            where = f"{where}: `{line.strip()[:60]}`"
            if re.fullmatch(r"(build/(\S*/)?)?handsim", words[0]):
                check_handsim(words[1:], program, problems, where)
            elif words[0] == "./dev":
                check_dev(words[1:], problems, where)
            elif words[0] == "ctest":
                check_tests(words, problems, where, sources)


def check_sources(problems):
    """Checks source files that pages name: `hand/person.cpp`, `handsim/engine/engine.h`, `python/handsim/export.py`."""
    for page in tables.PAGES:
        text = without_code(page.read_text())
        for name in re.finditer(r"`([a-z_0-9]+/[a-z_0-9/]*\.(?:cpp|h|py))`", text):
            path = name.group(1).removeprefix("handsim/")
            if not (ROOT / "src/handsim" / path).exists() and not (ROOT / path).exists():
                problems.append(f"{place(page, text, name.start())}: no src/handsim/{path}")


def keys_of(schema):
    """Names of all properties; referenced files have separate schemas."""
    found = set()
    for inner in schema.get("anyOf", []):
        found |= keys_of(inner)
    for key, inner in schema.get("properties", {}).items():
        found |= {key} | keys_of(inner)
    for part in ("items", "additionalProperties"):
        if isinstance(schema.get(part), dict):
            found |= keys_of(schema[part])
    return found


def check_keys(handsim, problems):
    for kind, pages in KEY_PAGES.items():
        schema = json.loads(subprocess.run([handsim, "schema", kind], capture_output=True, text=True).stdout)
        text = "".join((ROOT / "docs" / page).read_text() for page in pages)
        code = re.findall(r"`[^`]+`", without_code(text)) + [block.group(2) for block in FENCE.finditer(text)]
        named = set(re.findall(r"\w+", " ".join(code)))
        problems += [f"docs/{pages[0]}: lacks key {key} of handsim schema {kind}" for key in sorted(keys_of(schema) - named)]
    for page in tables.PAGES:
        text = page.read_text()
        for old, new in zip(text.splitlines(), keys.with_keys(text, handsim).splitlines()):
            if old != new:
                problems.append(f"docs/{page.name}: has {old}, need {new} (./dev docs keys)")


def check(handsim):
    problems = []
    lines = len((ROOT / "README.md").read_text().splitlines())
    if lines > README_LINES:
        problems.append(f"README.md: {lines} lines, at most {README_LINES}")
    check_blocks(problems)
    check_links(problems)
    renders.check(problems)
    check_sources(problems)
    if Path(handsim).exists():
        program = Program(handsim)
        check_commands(program, problems)
        check_keys(handsim, problems)
    else:
        problems.append(f"{handsim}: not built, so commands are not checked")
    print("\n".join(problems) or "docs: every table, link, picture and command is right")
    return 1 if problems else 0
