#!/usr/bin/env python3
"""Writes what `kalmems help TOPIC` prints as a page of the book, book/src/topics.md.

    tools/topics.py            writes the page
    tools/topics.py --check    fails if the page is another one
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TOPICS = ROOT / "crates/kalmems-engines/src/topics"
PAGE = ROOT / "book/src/topics.md"
# A topic in the list of mod.rs: its name, its chapter and what it is about.
LISTED = re.compile(r'^    "(\w+)", "(\w+\.md)", "([^"]+)";$', re.MULTILINE)


def page() -> str:
    listed = LISTED.findall((TOPICS / "mod.rs").read_text(encoding="utf-8"))
    blocks = [
        "# Topics of the help",
        "<!-- tools/topics.py writes this page from crates/kalmems-engines/src/topics. -->",
        "Warnings and verdicts end with a command such as `kalmems help TOPIC`. These are the texts that it prints, and that reports have at their end.",
        "| topic | about | chapter |\n|---|---|---|\n"
        + "\n".join(f"| [{name}](#{name}) | {about} | [{chapter}]({chapter}) |" for name, chapter, about in listed),
    ]
    for name, _, _ in listed:
        text = (TOPICS / f"{name}.txt").read_text(encoding="utf-8").strip()
        blocks += [f"## {name}", f"```text\n{text}\n```"]
    return "\n\n".join(blocks) + "\n"


def main() -> int:
    wanted = page()
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(wanted, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != wanted:
        print("book/src/topics.md is not what the topics say: run tools/topics.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
