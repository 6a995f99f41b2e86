#!/usr/bin/env python3
"""Writes the reference of all keys, book/src/keys.md, from the schemas that the command prints.

    tools/keys.py KALMEMS            writes the page; KALMEMS is the command, such as target/release/kalmems
    tools/keys.py KALMEMS --check    fails if the page is another one
"""

import json
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).resolve().parent.parent / "book/src/keys.md"
FILES = {
    "experiment": "An experiment file",
    "study": "A study file",
    "image": "An image file",
    "spectrum": "A spectrum file",
    "gyro": "A calibration file",
}


def cell(text: str) -> str:
    """A text as one cell of a table."""
    return " ".join(text.split()).replace("|", "\\|")


class Schema:
    """A schema, walked from its root: each of its tables has a section, at the first place that has it."""

    def __init__(self, root: dict, written: dict[str, str]):
        self.root, self.written, self.found = root, written, []

    def resolved(self, part: dict) -> dict:
        while "$ref" in part:
            target = self.root["$defs"][part["$ref"].rsplit("/", 1)[1]]
            part = {**target, **{key: value for key, value in part.items() if key != "$ref"}}
        return part

    def variants(self, part: dict) -> list[dict]:
        return [self.resolved(one) for one in part.get("oneOf", part.get("anyOf", []))]

    def is_value(self, part: dict) -> bool:
        """A value with a unit is an object in its long form, and no table."""
        return "pattern" in part or "title" in part

    def tables(self, part: dict) -> list[dict]:
        part = self.resolved(part)
        if self.is_value(part):
            return []
        if "properties" in part:
            return [part]
        if isinstance(part.get("items"), dict):
            return self.tables(part["items"])
        inner = part.get("additionalProperties")
        found = self.tables(inner) if isinstance(inner, dict) else []
        return found + [table for one in self.variants(part) for table in self.tables(one)]

    def words(self, part: dict) -> list[tuple[str, str]]:
        """The words that a key may be, each with what it means."""
        part = self.resolved(part)
        found = [(one, "") for one in part.get("enum", [])] + [
            (one["const"], one.get("description", "")) for one in self.variants(part) if isinstance(one.get("const"), str)
        ]
        return found + ([(part["const"], "")] if isinstance(part.get("const"), str) else [])

    def kind(self, part: dict) -> str:
        """What a key takes, with an example."""
        part = self.resolved(part)
        words = self.words(part)
        names = {"boolean": "`true` or `false`", "integer": "a whole number", "number": "a number", "string": "a text", "array": "a list", "object": "a table"}
        kind = part.get("title") or ""
        if not kind and isinstance(part.get("items"), dict):
            kind = f"a list, each {self.kind(part['items'])}"
        elif not kind and words and len(words) == max(len(self.variants(part)), len(part.get("enum", [])), 1):
            kind = ", ".join(f"`{word}`" for word, _ in words)
        elif not kind and "const" in part:
            kind = f"`{json.dumps(part['const'])}`"
        elif not kind and self.variants(part) and "properties" not in part:
            kind = " or ".join(dict.fromkeys(self.kind(one) for one in self.variants(part) if one.get("type") != "null"))
        elif not kind:
            types = part.get("type", "object")
            kind = " or ".join(names.get(one, one) for one in ([types] if isinstance(types, str) else types))
        limits = [f"{sign} {part[key]}" for key, sign in (("minimum", "≥"), ("exclusiveMinimum", ">"), ("maximum", "≤"), ("exclusiveMaximum", "<")) if key in part]
        if part.get("type") in ("integer", "number") and limits:
            kind += " (" + ", ".join(limits) + ")"
        example = next((one for one in part.get("examples", []) if isinstance(one, str) and not words), None)
        return kind + (f", such as `\"{example}\"`" if example else "")

    def described(self, part: dict, path: str) -> str:
        text = part.get("description") or self.resolved(part).get("description", "")
        if any(meaning for _, meaning in self.words(part)):
            text += " " + " ".join(f"`{word}`: {meaning}" for word, meaning in self.words(part) if meaning)
        if self.tables(part):
            text += f" [Keys](#{anchor(self.section(part, path))})."
        if "default" in part and not isinstance(part["default"], (dict, list, type(None))):
            text += f" Default: `{json.dumps(part['default'])}`."
        return cell(text)

    def section(self, part: dict, path: str) -> str:
        """The heading of the keys of a part: that at its first place."""
        tables = self.tables(part)
        identity = json.dumps([table["properties"] for table in tables], sort_keys=True)
        if identity not in self.written:
            self.written[identity] = path
            self.found.append((path, part, tables))
        return self.written[identity]

    def walk(self, title: str) -> list[str]:
        lines = [f"## {title}", ""]
        self.rows(lines, [self.root], "")
        waiting, self.found = self.found, []
        while waiting:
            path, part, tables = waiting.pop(0)
            lines += ["", f"### {path}", ""]
            whole = cell(self.resolved(part).get("description", "") if len(tables) == 1 else "")
            lines += [whole, ""] if whole else []
            self.rows(lines, tables, path + ".")
            # The tables of a table follow it.
            waiting, self.found = self.found + waiting, []
        return lines

    def rows(self, lines: list[str], tables: list[dict], prefix: str) -> None:
        lines += ["| key | takes | meaning |", "|---|---|---|"]
        seen = set()
        for table in tables:
            needed = table.get("required", [])
            for key, part in table["properties"].items():
                if key in seen:
                    continue
                seen.add(key)
                mark = " (needed)" if key in needed and len(tables) == 1 else ""
                lines.append(f"| `{key}`{mark} | {cell(self.kind(part))} | {self.described(part, prefix + key)} |")


def anchor(heading: str) -> str:
    return "".join("-" if one == " " else one for one in heading.lower() if one.isalnum() or one in " -_")


def page(command: str) -> str:
    lines = [
        "# All keys",
        "",
        "<!-- tools/keys.py writes this page from what `kalmems schema` prints. -->",
        "",
        "Each table of a file has its keys here, with their units, limits and meanings, as the program states them (`kalmems schema experiment`,",
        "`study`, `image`, `spectrum` and `gyro`). A heading is the path of the table in the file: `estimate.filter` is `[[estimate.filter]]`.",
        "`kalmems help device NAME` lists channels, states and parameters of a device.",
    ]
    written: dict[str, str] = {}
    for of, title in FILES.items():
        printed = subprocess.run([command, "schema", of], check=True, capture_output=True, text=True).stdout
        lines += ["", *Schema(json.loads(printed), written).walk(title)]
    return "\n".join(lines) + "\n"


def main() -> int:
    arguments = [one for one in sys.argv[1:] if one != "--check"]
    if len(arguments) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    wanted = page(arguments[0])
    if "--check" not in sys.argv[1:]:
        PAGE.write_text(wanted, encoding="utf-8")
    elif PAGE.read_text(encoding="utf-8") != wanted:
        print("book/src/keys.md is not what the schemas give: run tools/keys.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
