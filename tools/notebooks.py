#!/usr/bin/env python3
"""Runs the notebooks of the Python package and writes them as chapters of the book, with what they print and draw.

    tools/notebooks.py            runs all of them; needs nbclient, and what the notebooks import
    tools/notebooks.py --check    whether the chapters have the text and the code of the notebooks, without running them

The chapters are book/src/notebook_NAME.md, their pictures book/src/figures/notebook_NAME_N.png.
"""

from __future__ import annotations

import argparse
import base64
import html
import json
import re
import sys
import textwrap
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = ROOT / "python/notebooks"
BOOK = ROOT / "book/src"

# How Python prints a warning: the file, the line and the kind, and below it the line of code.
WARNING = re.compile(r"^\S+:\d+: (\w+Warning: .*)\n(?:  .*\n?)?", re.MULTILINE)
# A folder that is another one on each machine.
TEMPORARY = re.compile(r"/tmp/\w+")


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--check", action="store_true")
    told = arguments.parse_args()
    notebooks = sorted(NOTEBOOKS.glob("*.ipynb"))
    if told.check:
        stale = [path.name for path in notebooks if not is_chapter_of(path)]
        if stale:
            print(f"the book has another text or code than {', '.join(stale)}: run tools/notebooks.py", file=sys.stderr)
            return 1
        print(f"{len(notebooks)} notebooks are chapters of the book")
        return 0
    for path in notebooks:
        chapter(path).write_text(rendered(path), encoding="utf-8")
        print(chapter(path).relative_to(ROOT))
    return 0


def chapter(notebook: Path) -> Path:
    return BOOK / f"notebook_{notebook.stem}.md"


def cells(notebook: Path) -> list[dict[str, Any]]:
    return list(json.loads(notebook.read_text(encoding="utf-8"))["cells"])


def source(cell: Any) -> str:
    """The text of a cell as its chapter has it."""
    text = "".join(cell["source"]).strip()
    return text if cell["cell_type"] == "markdown" else f"```py\n{text}\n```"


def is_chapter_of(notebook: Path) -> bool:
    """Whether the chapter has every cell of the notebook, in their order."""
    text, place = chapter(notebook).read_text(encoding="utf-8") if chapter(notebook).exists() else "", 0
    for cell in cells(notebook):
        place = text.find(source(cell), place)
        if place < 0:
            return False
    return True


def rendered(notebook: Path) -> str:
    import nbclient
    import nbformat

    document = nbformat.read(notebook, as_version=4)
    nbclient.NotebookClient(document, timeout=900, resources={"metadata": {"path": str(NOTEBOOKS)}}).execute()
    for old in (BOOK / "figures").glob(f"notebook_{notebook.stem}_*.png"):
        old.unlink()
    parts, pictures = [], 0
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
                pictures += 1
                name = f"notebook_{notebook.stem}_{pictures}.png"
                (BOOK / "figures" / name).write_bytes(base64.b64decode(data["image/png"]))
                parts.append(f"![{subject}](figures/{name})")
            elif text := printed(output):
                parts.append(text)
    return "\n\n".join(parts) + "\n"


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
        told = "".join(output["text"])
        if output["name"] == "stderr":
            lines = WARNING.sub(r"\1\n", told).splitlines()
            told = "\n".join(textwrap.fill(line, 100, subsequent_indent="  ") for line in lines)
        return block(told)
    data = output.get("data", {})
    page = "".join(data.get("text/html", ""))
    if page.startswith("<pre>"):
        return block(html.unescape(page.removeprefix("<pre>").removesuffix("</pre>")))
    # Tables of other libraries bring styles of their own; their text says the same.
    if page and "<style" not in page:
        return '<div style="overflow-x: auto">\n' + re.sub(r"\n\s*\n", "\n", page) + "\n</div>"
    return block("".join(data.get("text/plain", "")))


def block(text: str) -> str:
    text = TEMPORARY.sub("/tmp/folder", text.rstrip())
    return f"```text\n{text}\n```" if text else ""


if __name__ == "__main__":
    sys.exit(main())
