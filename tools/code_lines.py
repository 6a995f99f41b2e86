#!/usr/bin/env python3
"""Counts the lines of code of each crate, without comments, blank lines and tests.

    tools/code_lines.py [--repeats] [--against COMMIT]
    tools/code_lines.py --self-test

Counted is what stands under `crates/*/src`. Left out are items under `#[cfg(test)]` and the files of modules that are declared
so. A line within a string counts if it is not blank. The code that reproduces the papers is counted as `kalmems-papers`: that
crate, or, in a tree without it, the modules `reproduction` of the rigs and `reproduce` of the engines.

`--repeats` also looks for repeats: runs of at least 8 lines of code that stand in two places with the same shape. In a shape,
identifiers that begin with a lower-case letter, numbers, characters and strings are placeholders; keywords, types and punctuation
are kept, and the further lines of a string of several lines are kept as they are. The head of a function, from its `fn` to its
`{`, is one line of a run however many lines the formatter made of it: it has to be what its trait says in each implementation, and
a long one alone is no repeat. The longest runs are taken first. Each line is
counted as a repeat of another once: a run that stands in three places gives two repeats, and whatever of a shorter run is
already in a longer one is left out. A run with fewer than 4 different shapes is a list (of modules, or of the rows of a table) and
no repeat.

`--against` prints the same counts of a commit beside those of the working tree.
"""

import argparse
import collections
import io
import pathlib
import re
import subprocess
import sys
import tarfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PAPERS = "kalmems-papers"
# Where the papers are reproduced in a tree without a crate for them.
REPRODUCTIONS = re.compile(r"crates/(kalmems-rigs/src/[^/]+/reproduction|kalmems-engines/src/reproduce)(/|\.rs$)")
SHORTEST = 8
FEWEST_SHAPES = 4
LONGEST_LISTED = 20

KEYWORDS = frozenset(
    """as async await box break const continue crate dyn else enum extern false fn for if impl in let loop macro_rules match mod move
    mut pub ref return self static struct super trait true type unsafe use where while yield""".split()
)
PRIMITIVES = frozenset(
    "bool char f32 f64 i8 i16 i32 i64 i128 isize str u8 u16 u32 u64 u128 usize".split()
)

TOKEN = re.compile(
    r"""
      (?P<space>\s+)
    | (?P<comment>//[^\n]*)
    | (?P<block>/\*)
    | (?P<raw>(?:br|cr|r)(?P<hashes>\#*)")
    | (?P<string>[bc]?"(?:[^"\\]|\\.)*")
    | (?P<char>b?'(?:\\u\{[^}]*\}|\\x[0-9a-fA-F]{2}|\\.|[^\\'\n])')
    | (?P<lifetime>'[^\W\d]\w*)
    | (?P<word>(?:r\#)?[^\W\d]\w*)
    | (?P<number>0[xbo]\w+|\d[\d_]*(?:\.(?![.\w])|\.\d[\d_]*)?(?:[eE][+-]?\d[\d_]*)?\w*)
    | (?P<punctuation>.)
    """,
    re.VERBOSE | re.DOTALL,
)

# One token: what it is, its text, and the lines from its first to its last, counted from 0.
Token = collections.namedtuple("Token", "kind text first last")
# What is compared as one line: its first and last number, counted from 1, how many lines of code that is, and its shape.
Line = collections.namedtuple("Line", "number last count shape")
# A run of lines that repeats an earlier one; both places are a file and the index of a line of code in it.
Repeat = collections.namedtuple("Repeat", "length earlier later")


def tokens_of(text):
    """The tokens of a source without its spaces and comments."""
    tokens, at, line = [], 0, 0
    while at < len(text):
        match = TOKEN.match(text, at)
        kind, end = match.lastgroup, match.end()
        if kind == "block":
            end = end_of_block_comment(text, at)
        elif match["raw"] is not None:
            # What closes it has as many hashes as what opens it.
            kind, closing = "string", '"' + match["hashes"]
            found = text.find(closing, end)
            end = len(text) if found < 0 else found + len(closing)
        last = line + text.count("\n", at, end)
        if kind not in ("space", "comment", "block"):
            tokens.append(Token(kind, text[at:end], line, last))
        at, line = end, last
    return tokens


def end_of_block_comment(text, at):
    """Where a block comment that begins at `at` ends; block comments nest."""
    depth = 0
    for mark in re.compile(r"/\*|\*/").finditer(text, at):
        depth += 1 if mark[0] == "/*" else -1
        if depth == 0:
            return mark.end()
    return len(text)


def end_of_group(tokens, at):
    """The index behind the bracket that closes the one at `at`."""
    depth = 0
    for index in range(at, len(tokens)):
        if tokens[index].kind == "punctuation":
            if tokens[index].text in "([{":
                depth += 1
            elif tokens[index].text in ")]}":
                depth -= 1
                if depth == 0:
                    return index + 1
    return len(tokens)


def holds_outside_tests(predicate):
    """Whether the texts of a `cfg` hold where no test is compiled: `True`, `False`, or `None` where it depends."""
    if predicate == ["test"]:
        return False
    if len(predicate) < 3 or predicate[1] != "(":
        return None
    parts, depth = [[]], 0
    for text in predicate[2:-1]:
        if text == "," and depth == 0:
            parts.append([])
            continue
        depth += (text == "(") - (text == ")")
        parts[-1].append(text)
    values = [holds_outside_tests(part) for part in parts if part]
    if predicate[0] == "not":
        return None if values[0] is None else not values[0]
    if predicate[0] == "all":
        return False if False in values else None if None in values else True
    if predicate[0] == "any":
        return True if True in values else None if None in values else False
    return None


def is_for_tests(attribute):
    """Whether an attribute, from `[` to `]`, leaves its item to tests alone."""
    texts = [token.text for token in attribute]
    return texts[1:3] == ["cfg", "("] and holds_outside_tests(texts[3:-2]) is False


def end_of_item(tokens, at):
    """The index behind the item, field or statement that begins at `at`, behind its attributes."""
    start = at
    if tokens[at].text == "pub":
        at += 1
        if at < len(tokens) and tokens[at].text == "(":
            at = end_of_group(tokens, at)
    words = [token.text for token in tokens[at : at + 2]]
    # These end at a semicolon, whatever braces are in them.
    to_semicolon = words[:1] in (["use"], ["static"], ["type"], ["let"]) or (
        words[:1] == ["const"] and words[1:] not in (["fn"], ["unsafe"], ["async"], ["extern"])
    )
    is_item = tokens[at].kind == "word" and tokens[at].text in KEYWORDS or words[1:] == ["!"]
    index = start
    while index < len(tokens):
        text = tokens[index].text if tokens[index].kind == "punctuation" else ""
        if text and text in "([{":
            index = end_of_group(tokens, index)
            if text == "{" and not to_semicolon:
                return index
        elif text == ";" or text == "," and not is_item:
            return index + 1
        elif text and text in ")]}":
            return index
        else:
            index += 1
    return index


def without_tests(tokens, folder):
    """The tokens without what is for tests alone, and where the modules lie that are declared so, without their endings.

    `folder` is where the modules of the file lie.
    """
    kept, modules, index = [], [], 0
    # The inline modules around a token: the name, and the index at which each ends.
    inside = []
    while index < len(tokens):
        while inside and index >= inside[-1][1]:
            inside.pop()
        if [token.text for token in tokens[index : index + 2]] == ["#", "["]:
            begin, for_tests, path = index, False, None
            while [token.text for token in tokens[index : index + 2]] == ["#", "["]:
                end = end_of_group(tokens, index + 1)
                attribute = tokens[index + 1 : end]
                for_tests = for_tests or is_for_tests(attribute)
                if [token.text for token in attribute[1:3]] == ["path", "="]:
                    path = attribute[3].text.strip('"')
                index = end
            if for_tests and index < len(tokens):
                end = end_of_item(tokens, index)
                item = [token.text for token in tokens[index:end]]
                if item[-3:-2] == ["mod"] and item[-1] == ";":
                    around = "/".join([folder, *(name for name, _ in inside)])
                    modules.append((around, path or item[-2]))
                index = end
            else:
                kept += tokens[begin:index]
            continue
        if [token.text for token in tokens[index : index + 3]] == ["#", "!", "["]:
            end = end_of_group(tokens, index + 2)
            if is_for_tests(tokens[index + 2 : end]):
                # All of the file, or of the inline module, whose braces stay.
                index = inside[-1][1] - 1 if inside else len(tokens)
                continue
            kept += tokens[index:end]
            index = end
            continue
        if tokens[index].text == "mod" and [token.text for token in tokens[index + 2 : index + 3]] == ["{"]:
            inside.append((tokens[index + 1].text, end_of_group(tokens, index + 2)))
        kept.append(tokens[index])
        index += 1
    return kept, modules


def shape_of(token):
    """What a token counts as in a comparison."""
    if token.kind in ("number", "lifetime"):
        return "0" if token.kind == "number" else "'a"
    if token.kind in ("string", "char"):
        return '""'
    if token.kind == "word" and token.text not in KEYWORDS and token.text not in PRIMITIVES:
        if token.text.removeprefix("r#")[0].islower() or token.text[0] == "_":
            return "x"
    return token.text


def code_lines(text, tokens):
    """The lines of code with their shapes."""
    lines, shapes = text.split("\n"), {}
    for token in tokens:
        shapes.setdefault(token.first, []).append(shape_of(token))
        for line in range(token.first + 1, token.last + 1):
            if lines[line].strip():
                shapes.setdefault(line, []).append(lines[line].strip())
    found, heads = [], heads_of(tokens)
    for line, shape in sorted(shapes.items()):
        shape = " ".join(shape)
        if found and line < found[-1].last:
            head = found[-1]
            # A list that is broken ends with a comma.
            joined = f"{head.shape} {shape}".replace(" , )", " )").replace(" , >", " >")
            found[-1] = head._replace(count=head.count + 1, shape=joined)
        else:
            found.append(Line(line + 1, heads.get(line, line) + 1, 1, shape))
    return found


def heads_of(tokens):
    """The last line of each head of a function by its first; lines are counted from 0."""
    heads = {}
    for start, token in enumerate(tokens):
        names = [token.kind for token in tokens[start + 1 : start + 2]] == ["word"]
        if token.kind != "word" or token.text != "fn" or not names:
            continue
        index = start
        while index < len(tokens) and tokens[index].text not in ("{", ";"):
            index = end_of_group(tokens, index) if tokens[index].text in ("(", "[") else index + 1
        if index < len(tokens):
            heads[token.first] = tokens[index].last
    return heads


def folder_of_modules(path):
    """Where the modules of a file lie."""
    path = pathlib.PurePosixPath(path)
    return str(path.parent if path.name in ("lib.rs", "main.rs", "mod.rs") else path.with_suffix(""))


def code_of(sources):
    """The lines of code of each file that is not for tests alone, from paths and texts."""
    code, for_tests = {}, set()
    for path, text in sorted(sources.items()):
        tokens, modules = without_tests(tokens_of(text), folder_of_modules(path))
        code[path] = code_lines(text, tokens)
        for around, module in modules:
            if module.endswith(".rs"):
                for_tests.add(str(pathlib.PurePosixPath(path).parent / module))
            else:
                for_tests.update((f"{around}/{module}.rs", f"{around}/{module}/"))
    folders = tuple(place for place in for_tests if place.endswith("/"))
    return {path: lines for path, lines in code.items() if path not in for_tests and not path.startswith(folders)}


def crate_of(path, has_papers):
    """The crate that a file is counted for."""
    if not has_papers and REPRODUCTIONS.match(path):
        return PAPERS
    return path.split("/")[1]


def sizes(code):
    """The lines of code of each crate."""
    has_papers = any(path.startswith(f"crates/{PAPERS}/") for path in code)
    counts = collections.Counter()
    for path, lines in code.items():
        counts[crate_of(path, has_papers)] += sum(line.count for line in lines)
    return counts


def repeats(code):
    """The runs that stand in two places, the longest first."""
    ids, sequence, places = {}, [], []
    for path, lines in sorted(code.items()):
        for index, line in enumerate(lines):
            sequence.append(ids.setdefault(line.shape, len(ids)))
            places.append((path, index))
        # Equal to nothing: no run goes over the end of a file.
        sequence.append(-1 - len(places))
        places.append(None)

    starts = collections.defaultdict(list)
    for at in range(len(sequence) - SHORTEST + 1):
        starts[tuple(sequence[at : at + SHORTEST])].append(at)
    runs = []
    for positions in starts.values():
        for number, later in enumerate(positions):
            for earlier in positions[:number]:
                # From its first line on alone.
                if earlier > 0 and sequence[earlier - 1] == sequence[later - 1]:
                    continue
                length = SHORTEST
                while later + length < len(sequence) and sequence[earlier + length] == sequence[later + length]:
                    length += 1
                # The two places of a list that repeats itself do not overlap.
                length = min(length, later - earlier)
                if length >= SHORTEST and len(set(sequence[later : later + length])) >= FEWEST_SHAPES:
                    runs.append((length, earlier, later))

    runs.sort(key=lambda run: (-run[0], run[2], run[1]))
    is_repeat, found = [False] * len(sequence), []
    for length, earlier, later in runs:
        at = 0
        while at < length:
            free = at
            while free < length and not is_repeat[later + free]:
                free += 1
            if free - at >= SHORTEST and len(set(sequence[later + at : later + free])) >= FEWEST_SHAPES:
                is_repeat[later + at : later + free] = [True] * (free - at)
                found.append(Repeat(free - at, places[earlier + at], places[later + at]))
            at = free + 1
    return sorted(found, key=lambda repeat: (-repeat.length, repeat.later, repeat.earlier))


def repeats_by_crates(code, found):
    """The number of runs and the lines in them for each pair of crates."""
    has_papers = any(path.startswith(f"crates/{PAPERS}/") for path in code)
    pairs = collections.defaultdict(lambda: (0, 0))
    for repeat in found:
        pair = tuple(sorted(crate_of(path, has_papers) for path, _ in (repeat.earlier, repeat.later)))
        runs, lines = pairs[pair]
        pairs[pair] = (runs + 1, lines + repeat.length)
    return pairs


def place_of(code, place, length):
    """A run as a reader finds it: the file, its first and its last line."""
    path, index = place
    return f"{path}:{code[path][index].number}-{code[path][index + length - 1].last}"


def sources_here():
    """The sources of the working tree."""
    files = ROOT.glob("crates/*/src/**/*.rs")
    return {file.relative_to(ROOT).as_posix(): file.read_text("utf-8") for file in files}


def sources_at(commit):
    """The sources of a commit."""
    archive = subprocess.run(
        ["git", "archive", "--format=tar", commit, "crates"], cwd=ROOT, stdout=subprocess.PIPE, check=False
    )
    if archive.returncode != 0:
        sys.exit(f"git archive gave no sources of {commit}")
    with tarfile.open(fileobj=io.BytesIO(archive.stdout)) as tar:
        files = [file for file in tar if file.isfile() and re.fullmatch(r"crates/[^/]+/src/.+\.rs", file.name)]
        return {file.name: tar.extractfile(file).read().decode("utf-8") for file in files}


def print_table(head, rows):
    """A table whose first column is text and whose others are numbers."""
    rows = [[str(cell) for cell in row] for row in [head, *rows]]
    widths = [max(len(row[column]) for row in rows) for column in range(len(head))]
    for row in rows:
        print("  ".join([row[0].ljust(widths[0])] + [cell.rjust(width) for cell, width in zip(row[1:], widths[1:])]))


def print_sizes(trees):
    """The lines of code of each crate, tree by tree."""
    counts = [sizes(code) for _, code in trees]
    rows = [[crate, *(count[crate] for count in counts)] for crate in sorted(set().union(*counts))]
    rows.append(["total", *(sum(count.values()) for count in counts)])
    rows.append([f"total without {PAPERS}", *(sum(count.values()) - count[PAPERS] for count in counts)])
    if len(trees) == 2:
        rows = [[*row, f"{row[1] - row[2]:+}"] for row in rows]
    print_table(["lines of code", *(name for name, _ in trees), "difference"][: len(trees) * 2], rows)


def print_repeats(trees):
    """The repeats of each pair of crates, tree by tree, and the longest of the first tree."""
    found = [repeats(code) for _, code in trees]
    pairs = [repeats_by_crates(code, repeats) for (_, code), repeats in zip(trees, found)]
    rows = []
    for pair in sorted(set().union(*pairs)):
        name = f"within {pair[0]}" if pair[0] == pair[1] else " and ".join(pair)
        rows.append([name, *(number for by_pair in pairs for number in by_pair.get(pair, (0, 0)))])
    rows.append(["total", *(sum(row[column] for row in rows) for column in range(1, 1 + 2 * len(trees)))])
    if len(trees) == 2:
        head = ["repeats", *(f"{what}, {name}" for name, _ in trees for what in ("runs", "lines"))]
    else:
        head = ["repeats", "runs", "lines"]
    print()
    print_table(head, rows)
    print(f"\nthe {LONGEST_LISTED} longest")
    code = trees[0][1]
    for repeat in found[0][:LONGEST_LISTED]:
        print(f"{repeat.length:4}  {place_of(code, repeat.later, repeat.length)}")
        print(f"      {place_of(code, repeat.earlier, repeat.length)}")


def self_test():
    """Checks of the tokenizer, of what is left out as a test, and of repeats."""

    def numbers(text, **others):
        sources = {"crates/a/src/lib.rs": text, **{f"crates/a/src/{path}.rs": more for path, more in others.items()}}
        return {path: [line.number for line in lines] for path, lines in code_of(sources).items()}

    def lines(text):
        return numbers(text)["crates/a/src/lib.rs"]

    def same(found, expected):
        if found != expected:
            raise SystemExit(f"self-test: found {found!r}, expected {expected!r}")

    # Comments and blank lines.
    same(lines("// a\n\nlet x = 1; // b\n/* c\n /* nested */ still\n*/ let y;\n"), [3, 6])
    same(lines("//! a\n/// b\nfn f() {}\n"), [3])
    # Strings.
    same(lines('let a = "// no comment"; let b = "\\"/*";\nc'), [1, 2])
    same(lines('let a = r#"\n"/*\n\n// text\n"#;\n// end\n'), [1, 2, 4, 5])
    same(lines('let a = br"\\"; // b\n// c\nlet d = b"\\\\"; e'), [1, 3])
    # Characters and lifetimes.
    same(lines("let a = '\"'; // \"\nfn f<'a>(x: &'a str, c: char) { c == '\\'' }\n// '\nb'\\\\'"), [1, 2, 4])
    same([token.text for token in tokens_of("'a: loop { 'b' r#fn 1..2 1.5e-3f64 1.max(0x1F) }")][:-1],
         ["'a", ":", "loop", "{", "'b'", "r#fn", "1", ".", ".", "2", "1.5e-3f64", "1", ".", "max", "(", "0x1F", ")"])
    # Tests.
    same(lines("a();\n#[cfg(test)]\nmod tests {\n    fn f() { \"}\" }\n}\nb();\n"), [1, 6])
    same(lines("#[allow(x)]\n#[cfg(test)]\npub(crate) use a::{b,\n c};\nd();\n"), [5])
    same(lines("#[cfg(test)]\nconst A: [u8; 2] = {\n [0; 2]\n};\n#[cfg(test)]\nconst fn f() {}\nb();\n"), [7])
    same(lines("struct A {\n#[cfg(test)]\na: B<C>,\nb: u8,\n}\n"), [1, 4, 5])
    same(lines("#[cfg(not(test))]\nfn f() {}\n#[cfg(any(test, unix))]\nfn g() {}\n"), [1, 2, 3, 4])
    same(lines("#[cfg(all(unix, test))]\nfn f<A, B>() {}\n#[cfg(any(test, all(test, unix)))]\nmod g {}\nh"), [5])
    same(lines("#![cfg(test)]\nfn f() {}\n"), [])
    same(lines("mod a {\n#![cfg(test)]\nfn f() {}\n}\nb"), [1, 4, 5])
    # Files of tests.
    same(sorted(numbers("#[cfg(test)]\nmod tests;\nmod a;", tests="x", **{"tests/b": "x", "a": "y"})),
         ["crates/a/src/a.rs", "crates/a/src/lib.rs"])
    same(sorted(numbers("mod a;", a="#[cfg(test)]\nmod b;", **{"a/b": "x", "b": "y"})),
         ["crates/a/src/a.rs", "crates/a/src/b.rs", "crates/a/src/lib.rs"])
    same(sorted(numbers("mod a { #[cfg(test)] mod b; }", **{"a/b": "x", "b": "y"})),
         ["crates/a/src/b.rs", "crates/a/src/lib.rs"])
    same(sorted(numbers("#[cfg(test)]\n#[path = \"c.rs\"]\nmod b;", **{"c": "x", "b": "y"})),
         ["crates/a/src/b.rs", "crates/a/src/lib.rs"])
    # The papers.
    same(crate_of("crates/kalmems-rigs/src/stage/reproduction/a.rs", False), PAPERS)
    same(crate_of("crates/kalmems-engines/src/reproduce.rs", False), PAPERS)
    same(crate_of("crates/kalmems-engines/src/reproduced.rs", False), "kalmems-engines")
    same(crate_of("crates/kalmems-engines/src/reproduce.rs", True), "kalmems-engines")

    # Repeats.
    form = "fn NAME(x: f64) -> Kind {\n    // NAME\n    let NAME = 1.5 * x;\n    if NAME > 2.0 {\n        return Kind::A;\n    }\n" \
        "    let y = \"NAME\";\n    g(y, NAME)\n}\n"

    def found(*texts):
        code = code_of({f"crates/{number}/src/lib.rs": text for number, text in enumerate(texts)})
        return [(repeat.length, place_of(code, repeat.later, repeat.length)) for repeat in repeats(code)]

    run = form.replace("NAME", "one")
    renamed = form.replace("    // NAME\n", "\n\n").replace("NAME", "other").replace("2.0", "3e-7")
    same(found(run, renamed), [(8, "crates/1/src/lib.rs:1-10")])
    same(found(run, "struct A;\n" + renamed + "struct B;\n"), [(8, "crates/1/src/lib.rs:2-11")])
    same(found(run + renamed), [(8, "crates/0/src/lib.rs:10-19")])
    same(found(run, renamed, run), [(8, "crates/1/src/lib.rs:1-10"), (8, "crates/2/src/lib.rs:1-9")])
    # Another type, another keyword, another operator.
    for old, new in [("f64", "f32"), ("Kind::A", "Kind::B"), ("if", "while"), (" * ", " + ")]:
        same(found(run, renamed.replace(old, new)), [])
    # The head of a function is one line, broken or not.
    head = "fn one(x: f64, y: f64) -> Kind {\n"
    broken = "fn other(\n    x: f64,\n    y: f64,\n) -> Kind {\n"
    same(found(run.replace("fn one(x: f64) -> Kind {\n", head), renamed.replace("fn other(x: f64) -> Kind {\n", broken)),
         [(8, "crates/1/src/lib.rs:1-13")])
    same(found(broken + "    1\n}\n", broken + "    x\n}\n"), [])
    same(sizes(code_of({"crates/a/src/lib.rs": broken + "}\n"})), {"a": 5})
    # Lists.
    same(found("mod a;\n" * 40), [])
    # A part of a longer run is not counted again.
    same(found(run + "struct A;\n" + run, run + "struct A;\n" + run),
         [(17, "crates/1/src/lib.rs:1-19"), (8, "crates/0/src/lib.rs:11-19")])
    print("self-test passed")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--repeats", action="store_true", help="also list runs that stand in two places")
    parser.add_argument("--against", metavar="COMMIT", help="also count at this commit")
    parser.add_argument("--self-test", action="store_true", help="check this script")
    arguments = parser.parse_args()
    if arguments.self_test:
        self_test()
        return
    trees = [("here", code_of(sources_here()))]
    if arguments.against:
        trees.append((arguments.against, code_of(sources_at(arguments.against))))
    print_sizes(trees)
    if arguments.repeats:
        print_repeats(trees)


if __name__ == "__main__":
    main()
