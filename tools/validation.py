#!/usr/bin/env python3
"""Writes the validation report, book/src/validation.md, from the results below book/validation.

    tools/validation.py            writes the page
    tools/validation.py --check    fails if the page is not what the files give, or if a command names a test that is not there

A file is a protocol: its `title`, the group of protocols that it belongs to, its `order` on the page, and its parts. A part has a `text`, a `heading`, or a
table: `columns`, `align` and `rows`, or `from`, a table that an example writes into book/src. What made it stands with it: `command`, `seeds`,
`version` of the program, `entered`, the day on which its newest row came into the repository, and `commit`, which brought it. A command that
runs again replaces `rows` and these five; nothing on the page is written by hand.
"""

import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "book/validation"
PAGE = ROOT / "book/src/validation.md"
KNOWN = {"title", "group", "order", "part"}
KNOWN_OF_PART = {
    "heading", "text", "caption", "columns", "align", "rows", "from", "command", "seeds", "version", "entered", "commit", "takes", "needs",
}
GROUPS = ["Claims and verdicts", "Signals with faults", "Recordings and streams", "Filters and devices", "Applications", "Time and memory"]


def cell(text: str) -> str:
    return text.replace("|", "\\|")


def table(part: dict) -> list[str]:
    """The lines of a table, of rows that are as long as its heading."""
    columns, align = part["columns"], part["align"]
    marks = {"left": "---", "right": "--:"}
    lines = ["| " + " | ".join(cell(one) for one in columns) + " |", "|" + "|".join(marks[one] for one in align) + "|"]
    for row in part["rows"]:
        if len(row) != len(columns) or len(align) != len(columns):
            raise ValueError(f"a row of {len(row)} cells under {len(columns)} columns: {row}")
        lines.append("| " + " | ".join(cell(one) for one in row) + " |")
    return lines


def origin(part: dict) -> str | None:
    """What made the rows, in one line."""
    said = [f"`{part['command']}`"] if "command" in part else []
    said += [f"seeds {part['seeds']}"] if "seeds" in part else []
    said += [part["needs"]] if "needs" in part else []
    said += [part["takes"]] if "takes" in part else []
    said += [f"version {part['version']}"] if "version" in part else []
    said += [f"entered {part['entered']} ({part['commit']})"] if "entered" in part else []
    return f"({'; '.join(said)}.)" if said else None


def shown(part: dict) -> list[str]:
    """The blocks of a part, each the lines between two blank ones."""
    blocks = []
    if "heading" in part:
        blocks.append(f"### {part['heading']}")
    if "text" in part:
        blocks.append(part["text"].strip("\n"))
    if "rows" in part:
        blocks.append("\n".join(table(part)))
    if "from" in part:
        written = (PAGE.parent / part["from"]).read_text(encoding="utf-8").strip()
        mark = "```text\n{}\n```" if part["from"].endswith(".txt") else "\n{}\n"
        blocks.append(f"<!-- from {part['from']} -->\n" + mark.format(written) + "\n<!-- end -->")
    made = origin(part)
    return blocks + ([made] if made else [])


def results() -> list[dict]:
    """All protocols, in the order of the page."""
    protocols = []
    for file in sorted(RESULTS.glob("*.toml")):
        protocol = tomllib.loads(file.read_text(encoding="utf-8"))
        unknown = set(protocol) - KNOWN | {key for part in protocol["part"] for key in set(part) - KNOWN_OF_PART}
        if unknown or protocol.get("group") not in GROUPS:
            raise ValueError(f"{file}: unknown {sorted(unknown)}, or no group of {GROUPS}")
        protocols.append(protocol)
    protocols.sort(key=lambda one: (GROUPS.index(one["group"]), one["order"]))
    return protocols


def page(protocols: list[dict]) -> str:
    blocks = [
        "# Validation report",
        "<!-- tools/validation.py writes this page from book/validation. -->",
        "The command below a table printed it; its newest row came into the repository on the day that stands there. A table without a command has none on record.\n"
        "Devices are simulated, unless a table names who measured a recording; nothing was measured on hardware of the project. The chapters say how to use the\n"
        "program, and this page says how well it then works.",
    ]
    for group in GROUPS:
        own = [one for one in protocols if one["group"] == group]
        if not own:
            continue
        blocks.append(f"**{group}:**\n" + ";\n".join(f"[{one['title']}](#{anchor(one['title'])})" for one in own) + ".")
    for protocol in protocols:
        blocks.append(f"## {protocol['title']}")
        blocks += [block for part in protocol["part"] for block in shown(part)]
    return "\n\n".join(blocks) + "\n"


def names_of_tests() -> dict[str, set[str]]:
    """The functions and modules of each test target, and under the empty name those of the crates themselves."""
    found: dict[str, set[str]] = {"": set()}
    for file in ROOT.glob("crates/*/*/**/*.rs"):
        place = file.relative_to(ROOT).parts
        if place[2] not in ("src", "tests"):
            continue
        target = "" if place[2] == "src" else place[3].removesuffix(".rs")
        text = file.read_text(encoding="utf-8")
        found.setdefault(target, set()).update(re.findall(r"\b(?:fn|mod) (\w+)", text), [file.stem])
    return found


def missing_tests(protocols: list[dict]) -> list[str]:
    """The commands whose filters name no test of their target."""
    known, missing = names_of_tests(), []
    for command in (part["command"] for protocol in protocols for part in protocol["part"] if "cargo test" in part.get("command", "")):
        words = command.split()
        target = words[words.index("--test") + 1] if "--test" in words else ""
        packages = [after for before, after in zip(words, words[1:]) if before in ("-p", "--test")]
        filters = [word for word in words if not word.startswith("-") and "=" not in word and word not in ("cargo", "test", *packages)]
        steps = [step for name in filters for step in name.split("::") if step]
        if any(not any(step in one for one in known.get(target, set())) for step in steps):
            missing.append(f"no test of `{command}`")
    return missing


def anchor(title: str) -> str:
    kept = "".join(one for one in title.lower() if one.isalnum() or one in " -_")
    return kept.replace(" ", "-")


def main() -> int:
    protocols = results()
    wanted = page(protocols)
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(wanted, encoding="utf-8")
        return 0
    faults = missing_tests(protocols)
    if PAGE.read_text(encoding="utf-8") != wanted:
        faults.append(f"{PAGE.relative_to(ROOT)} is not what book/validation gives: run tools/validation.py")
    print("\n".join(faults), file=sys.stderr, end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
