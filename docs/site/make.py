#!/usr/bin/env python3
"""Makes the website: `./dev site`. Writes the pages into build/site/pages (README, docs/, the API of Python and of the public C++
headers, notebooks, files that pages name), builds them with MkDocs into build/site/html, and checks every local link of the result.

Links of docs/ are those of the repository; here a link to a page, a picture or a file becomes one to its copy.
"""
import base64
import html.parser
import json
import os
import re
import shutil
import subprocess
import sys
import urllib.parse
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES, HTML = ROOT / "build/site/pages", ROOT / "build/site/html"
CONFIG = Path(__file__).with_name("mkdocs.yml")
MORE_PAGES = ["README.md", "CHANGELOG.md", "CONTRIBUTING.md"]
LARGEST = 200_000  # bytes of a file that has a page of its own
CODE = re.compile(r"^```.*?^```|`[^`\n]+`", re.S | re.M)
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
LANGUAGES = {".cpp": "cpp", ".h": "cpp", ".py": "python", ".yaml": "yaml", ".sh": "sh", ".cmake": "cmake", ".txt": "cmake"}

# Page of the Python API: what is on it.
PYTHON = {
    "Hand": ["handsim.Hand", "handsim._hand.Poses", "handsim.draw_persons"],
    "Scene and result": ["handsim.load", "handsim.scenes", "handsim.data_path", "handsim.Scene", "handsim.Muscle", "handsim.Result",
                         "handsim.Verdict"],
    "Simulation": ["handsim.Simulation", "handsim.Bodies", "handsim.Contacts", "handsim.Muscles"],
    "Batch": ["handsim.Batch"],
    "Studies": ["handsim.study"],
    "Tasks": ["handsim.gym"],
    "Tables": ["handsim.Table", "handsim.Quantities"],
    "Pictures and reports": ["handsim.png", "handsim.save_png", "handsim.contact_sheet", "handsim.report", "handsim.save_video"],
    "Errors": ["handsim.Error", "handsim.Problem", "handsim.Fault"],
}


def tracked():
    names = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    return [ROOT / name for name in names]


class Site:
    def __init__(self):
        self.tracked = tracked()
        self.wanted = []  # files and folders that pages name

    def target(self, path):
        """Where a file of the repository is among the pages."""
        name = path.relative_to(ROOT)
        if str(name) == "README.md":
            return "index.md"
        if str(name) in MORE_PAGES:
            return str(name).lower()
        if path.suffix == ".md" and path.parent == ROOT / "docs":
            return path.name
        if path.suffix in (".png", ".gif", ".svg"):
            return str(name)
        if path.suffix == ".ipynb":
            return f"notebooks/{path.stem}.md"
        if path not in self.wanted:
            self.wanted.append(path)
        return f"files/{name}/index.md" if path.is_dir() else f"files/{name}.md"

    def with_links(self, text, source, page):
        """The text of a file of the repository with links for its place among the pages."""
        def moved(link):
            address, _, anchor = link[2].partition("#")
            if not address or re.match(r"\w+:", address):
                return link[0]
            path = (source.parent / address).resolve()
            if not path.exists():
                raise SystemExit(f"site: {source.relative_to(ROOT)}: no {address}")
            to = os.path.relpath(self.target(path), Path(page).parent)
            if path.suffix in (".png", ".gif", ".svg"):
                self.copy(path)
            return f"{link[1]}{to}{'#' + anchor if anchor else ''}{link[3]}"

        out, at = [], 0
        for code in CODE.finditer(text):
            out += [LINK.sub(moved, text[at:code.start()]), code[0]]
            at = code.end()
        return "".join(out) + LINK.sub(moved, text[at:])

    def copy(self, path):
        to = PAGES / path.relative_to(ROOT)
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, to)

    def write(self, page, text):
        to = PAGES / page
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_text(text)

    def documents(self):
        for source in [*(ROOT / name for name in MORE_PAGES), *sorted((ROOT / "docs").glob("*.md"))]:
            page = self.target(source)
            self.write(page, self.with_links(source.read_text(), source, page))

    def files(self):
        """Pages of the files that others name; they are not searched."""
        head = "---\nsearch: {exclude: true}\nhide: [navigation, toc]\n---\n"
        while self.wanted:
            path = self.wanted.pop(0)
            page = self.target(path)
            self.wanted = [each for each in self.wanted if each != path]
            name = path.relative_to(ROOT)
            if (PAGES / page).exists():
                continue
            if path.is_dir():
                inside = sorted({path / each.relative_to(path).parts[0] for each in self.tracked if path in each.parents})
                listed = [f"- [{each.name}]({os.path.relpath(self.target(each), Path(page).parent)})" for each in inside
                          if each.is_dir() or is_text(each)]
                self.write(page, f"{head}# {name}/\n\n" + "\n".join(listed) + "\n")
            else:
                text = path.read_text().replace("\n```", "\n ```")
                self.write(page, f"{head}# {name}\n\n```{LANGUAGES.get(path.suffix, '')}\n{text}\n```\n")


def is_text(path):
    if path.stat().st_size > LARGEST or path.suffix in (".png", ".gif", ".svg", ".md", ".ipynb"):
        return False
    try:
        path.read_text()
    except UnicodeDecodeError:
        return False
    return True


def notebook_pages(site):
    """Cells, printed text and pictures of python/examples/*.ipynb."""
    out = []
    for path in sorted((ROOT / "python/examples").glob("*.ipynb")):
        page, text = site.target(path), []
        for cell in json.loads(path.read_text())["cells"]:
            source = "".join(cell["source"])
            text.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
            printed = "".join("".join(output.get("text", [])) for output in cell.get("outputs", []))
            text += [f"```text\n{printed.rstrip()}\n```"] if printed.strip() else []
            for output in cell.get("outputs", []):
                data = output.get("data", {})
                text += ["".join(data["text/html"])] if "text/html" in data else []
                if "image/png" in data:
                    picture = f"{path.stem}_{len(text)}.png"
                    (PAGES / page).parent.mkdir(parents=True, exist_ok=True)
                    (PAGES / page).with_name(picture).write_bytes(base64.b64decode(data["image/png"]))
                    text.append(f"![Output of the cell above]({picture})")
        site.write(page, "\n\n".join(text) + "\n")
        out.append(page)
    return out


def python_pages(site):
    out = []
    for title, names in PYTHON.items():
        page = f"api/{title.lower().replace(' ', '_')}.md"
        members = "    options: {{show_root_heading: false, show_root_toc_entry: false}}\n"
        bodies = [f"::: {name}\n" + (members.format() if name in ("handsim.study", "handsim.gym") else "") for name in names]
        site.write(page, f"# {title}\n\n" + "\n".join(bodies))
        out.append(page)
    return out


def parts_of(header):
    """Opening comment, and the declarations of a header with the comment above each."""
    lines = header.read_text().splitlines()
    opening = []
    while lines and lines[0].startswith("//"):
        opening.append(lines.pop(0)[2:].strip())
    found, comment, code, depth = [], [], [], 0
    for line in lines:
        bare = re.sub(r"//.*", "", line)
        if depth == 0 and not code:
            if line.startswith("///"):
                comment.append(line[3:].strip())
                continue
            if not bare.strip() or bare.startswith(("#", "namespace", "}", "using namespace")) or re.fullmatch(r"(class|struct) \w+;\s*", bare):
                comment = []
                continue
        code.append(line)
        depth += bare.count("{") - bare.count("}")
        if depth == 0 and re.search(r"[;}]\s*$", bare):
            found.append((comment, public(code)))
            comment, code = [], []
    return opening, found


def public(code):
    """The lines without private parts."""
    out, hidden = [], False
    for line in code:
        if re.match(r" (private|protected):", line):
            hidden = True
        elif re.match(r" public:|\};?", line):
            hidden = False
        if not hidden:
            out.append(line)
    return [line for k, line in enumerate(out) if line.strip() or (k + 1 < len(out) and not out[k + 1].startswith("}"))]


def name_of(code):
    text = "\n".join(code)
    for pattern in (r"^(?:template <[^>]*>\s*)?(?:struct|class|enum class|enum|concept)\s+(\w+)", r"^using\s+(\w+)", r"([\w~]+|operator\S+)\s*\(",
                    r"(\w+)\s*(?:=|\{|;)"):
        match = re.search(pattern, text)
        if match:
            return match[1]
    return text.split("\n")[0]


def header_pages(site):
    """A page for each header that docs/library.md names as public."""
    list_of = (ROOT / "src/cmake/installed_headers.cmake").read_text()
    names = re.search(r"set\(HANDSIM_PUBLIC_HEADERS\s+(.*?)\)", list_of, re.S)[1].split()
    out = []
    for name in sorted(names):
        opening, found = parts_of(ROOT / "src/handsim" / name)
        text = [f"# handsim/{name}", " ".join(opening), f"```cpp\n#include <handsim/{name}>\n```"]
        last = None
        for comment, code in found:
            title = name_of(code)
            if title != last:  # overloads are under one heading
                text.append(f"## `{title}`")
            last = title
            said = re.sub(r"\s*@(param|throws|returns?)\s+", lambda tag: f"\n\n**{tag[1]}** ", " ".join(comment))
            text += [re.sub(r"(?<![\w`])([<*_])", r"\\\1", said), "```cpp\n" + "\n".join(code) + "\n```"]
        page = f"api/cpp/{name.removesuffix('.h').replace('/', '_')}.md"
        site.write(page, "\n\n".join(part for part in text if part) + "\n")
        out.append(f"{name}: {page}")
    return out


class Links(html.parser.HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.addresses, self.ids = [], set()
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name == "id":
                self.ids.add(value)
            elif name in ("href", "src") and value and tag in ("a", "img", "script", "link"):
                self.addresses.append(value)


def check():
    """Every local link of the built pages, with its anchor, and every picture. :returns: problems"""
    pages = {path: Links(path) for path in HTML.rglob("*.html")}
    problems = []
    for path, page in pages.items():
        for address in page.addresses:
            to, _, anchor = urllib.parse.unquote(address.split("?")[0]).partition("#")
            if re.match(r"(https?|mailto|data|javascript):|//", address) or path.name == "404.html":
                continue
            there = (path.parent / to).resolve() if to else path
            there = there / "index.html" if there.is_dir() else there
            if not there.exists():
                problems.append(f"{path.relative_to(HTML)}: no {address}")
            elif anchor and there in pages and anchor not in pages[there].ids and not anchor.startswith("__"):
                problems.append(f"{path.relative_to(HTML)}: no anchor {address}")
    shown = {(path.parent / urllib.parse.unquote(each)).resolve() for path, page in pages.items() for each in page.addresses}
    problems += [f"{path.relative_to(HTML)}: a picture on no page" for path in (HTML / "renders").iterdir() if path not in shown]
    return problems, len(pages), sum(len(page.addresses) for page in pages.values())


def nav(notebooks, python, headers):
    """mkdocs.yml with the pages that are made here."""
    text = CONFIG.read_text().replace("../../build/site/", "").replace("../../python", str(ROOT / "python"))
    text += "  - Notebooks: [" + ", ".join(notebooks) + "]\n"
    text += "  - Python API: [" + ", ".join(python) + "]\n  - C++ API: [" + ", ".join(f"{{{each}}}" for each in headers) + "]\n"
    text += "  - More: [changelog.md, contributing.md]\n"
    return text


def main():
    shutil.rmtree(PAGES, ignore_errors=True)
    shutil.rmtree(HTML, ignore_errors=True)
    site = Site()
    site.documents()
    notebooks, python, headers = notebook_pages(site), python_pages(site), header_pages(site)
    site.files()
    shutil.copyfile(CONFIG.with_name("site.css"), PAGES / "site.css")
    config = PAGES.parent / "mkdocs.yml"
    config.write_text(nav(notebooks, python, headers))
    # With --quiet, MkDocs would not count its warnings.
    built = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "-f", config], check=False, text=True,
                           capture_output=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})
    if built.returncode != 0:
        print(re.sub(r"^INFO .*\n", "", built.stderr + built.stdout, flags=re.M))
        return 1
    problems, pages, links = check()
    print("\n".join(problems) or f"site: {pages} pages, {links} links and pictures, all of them there: {HTML.relative_to(ROOT)}/index.html")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
