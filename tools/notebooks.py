#!/usr/bin/env python3
"""Runs the notebooks of the Python package and writes them as chapters of the book, with what they print and draw.

    tools/notebooks.py            runs all of them and writes the chapters
    tools/notebooks.py --check    runs all of them and compares the chapters with their text, code and output; pictures are not compared

The chapters are book/src/notebook_NAME.md, their pictures book/src/figures/notebook_NAME_N.png. A long output is shown in part. Needs nbclient and
what the notebooks import: without them it runs in the environment that .ci/python makes.
"""

from __future__ import annotations

import argparse
import base64
import difflib
import html
import importlib.util
import os
import re
import sys
import textwrap
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = ROOT / "python/notebooks"
BOOK = ROOT / "book/src"
ENVIRONMENT = ROOT / "python/target/tools/bin/python"

# How Python prints a warning: the file, the line and the kind, and below it the line of code.
WARNING = re.compile(r"^\S+:\d+: (\w+Warning: .*)\n(?:  .*\n?)?", re.MULTILINE)
# What differs from run to run, and what the chapters have in its place, so that it is not compared: temporary folders, and the times per step that
# end a row of the table of estimators.
VARYING = (
    (re.compile(r"/tmp/\w+"), "/tmp/folder"),
    (re.compile(r"<td>[\d.]+ [nµm]?s</td></tr>"), "<td>…</td></tr>"),
)
# An output of more lines, and a notice of more characters, are shown in part.
LINES = 14
CHARACTERS = 140
# A notice in HTML, which has a colour, and of it what stands before the first comma or semicolon. The answer has none, and stays whole.
CLAUSE = re.compile(r"(<p style[^>]*>)((?:[^<&,;]|&[#\w]+;|</?code>)*).*</p>")


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--check", action="store_true")
    options = arguments.parse_args()
    if importlib.util.find_spec("nbclient") is None:
        if Path(sys.executable) == ENVIRONMENT or not ENVIRONMENT.exists():
            print("nbclient is not installed, and .ci/python has made no environment", file=sys.stderr)
            return 2
        os.execv(ENVIRONMENT, [str(ENVIRONMENT), *sys.argv])
    notebooks = sorted(NOTEBOOKS.glob("*.ipynb"))
    differing = 0
    for notebook in notebooks:
        text, pictures = rendered(notebook)
        if options.check:
            differing += difference(chapter(notebook), text, pictures)
            continue
        for old in (BOOK / "figures").glob(f"notebook_{notebook.stem}_*.png"):
            old.unlink()
        for name, picture in pictures.items():
            (BOOK / "figures" / name).write_bytes(picture)
        chapter(notebook).write_text(text, encoding="utf-8")
        print(chapter(notebook).relative_to(ROOT))
    if differing:
        print(f"chapters that differ from their notebooks: {differing}; run tools/notebooks.py", file=sys.stderr)
        return 1
    if options.check:
        print(f"{len(notebooks)} notebooks are chapters of the book, with their output")
    return 0


def chapter(notebook: Path) -> Path:
    return BOOK / f"notebook_{notebook.stem}.md"


def source(cell: Any) -> str:
    """The text of a cell as its chapter has it."""
    text = "".join(cell["source"]).strip()
    return text if cell["cell_type"] == "markdown" else f"```py\n{text}\n```"


def difference(page: Path, text: str, pictures: dict[str, bytes]) -> bool:
    """Whether the page differs from the text, or lacks a picture; each difference is printed."""
    there = page.read_text(encoding="utf-8") if page.exists() else ""
    lines = list(difflib.unified_diff(there.splitlines(), text.splitlines(), str(page.relative_to(ROOT)), "its notebook, run now", n=0, lineterm=""))
    lines += [f"{page.relative_to(ROOT)}: no picture {name}" for name in pictures if not (BOOK / "figures" / name).exists()]
    for line in lines:
        print(line, file=sys.stderr)
    return bool(lines)


def rendered(notebook: Path) -> tuple[str, dict[str, bytes]]:
    """The chapter of a notebook that is run now, and its pictures by their names."""
    import nbclient
    import nbformat

    document = nbformat.read(notebook, as_version=4)
    nbclient.NotebookClient(document, timeout=900, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    subject = ""
    for cell in document.cells:
        parts.append(source(cell))
        if cell["cell_type"] == "markdown":
            # What a picture below shows: the first sentence above it.
            subject = re.split(r"(?<=[.:])\s", parts[-1].lstrip("# ").replace("`", "").replace("\n", " "))[0].rstrip(":")
        if len(parts) == 1:
            parts.append(f"This page is the notebook `python/notebooks/{notebook.name}` with its output.")
        for output in joined(cell.get("outputs", ())):
            data = output.get("data", {})
            if "image/png" in data:
                name = f"notebook_{notebook.stem}_{len(pictures) + 1}.png"
                pictures[name] = base64.b64decode(data["image/png"])
                parts.append(f"![{subject}](figures/{name})")
            elif text := printed(output):
                parts.append(text)
    text = "\n\n".join(parts) + "\n"
    for varying, constant in VARYING:
        text = varying.sub(constant, text)
    return text, pictures


def joined(outputs: Any) -> list[Any]:
    """The outputs of a cell, those that were printed one after the other as one."""
    found: list[Any] = []
    for output in outputs:
        before = found[-1] if found else {}
        if output["output_type"] == "stream" == before.get("output_type") and output["name"] == before["name"]:
            before["text"] = "".join(before["text"]) + "".join(output["text"])
        else:
            found.append(output)
    return found


def printed(output: Any) -> str:
    """What a cell prints, as Markdown."""
    if output["output_type"] == "stream":
        text = "".join(output["text"])
        if output["name"] == "stderr":
            lines = [first_sentence(line) for line in WARNING.sub(r"\1\n", text).splitlines()]
            text = "\n".join(textwrap.fill(line, 100, subsequent_indent="  ") for line in lines)
        return block(text)
    data = output.get("data", {})
    page = "".join(data.get("text/html", ""))
    if page.startswith("<pre>"):
        return block(html.unescape(page.removeprefix("<pre>").removesuffix("</pre>")))
    # Tables of other libraries bring styles of their own; their text says the same.
    if page and "<style" not in page:
        lines = [first_clause(line) for line in page.splitlines() if line.strip()]
        return '<div style="overflow-x: auto">\n' + "\n".join(lines) + "\n</div>"
    return block("".join(data.get("text/plain", "")))


def block(text: str) -> str:
    lines = text.rstrip().splitlines()
    if len(lines) > LINES + 1:
        lines[LINES:] = [f"… ({len(lines) - LINES} more lines)"]
    return "\n".join(["```text", *lines, "```"]) if lines else ""


def first_sentence(warning: str) -> str:
    first, _, rest = warning.partition(". ")
    return f"{first}. …" if rest else warning


def first_clause(line: str) -> str:
    """A line of HTML, a long notice without what follows its first comma or semicolon."""
    if len(html.unescape(re.sub(r"<[^>]*>", "", line))) <= CHARACTERS:
        return line
    return CLAUSE.sub(lambda found: f"{found[1]}{found[2].rstrip()} …</p>", line)


if __name__ == "__main__":
    sys.exit(main())
