#!/usr/bin/env python3
"""Lists the names of types that are defined in more than one file, and fails where there are any.

    tools/type_names.py
    tools/type_names.py --self-test

Read are the files under `crates/*/src`, tests among them. A type is a struct, an enum, a trait, a union, or an alias that stands
by itself: an alias in an `impl` or a `trait` is an associated type, whose name the trait gives. Definitions in strings and in the
bodies of macros by example are left out, as are types whose name a macro makes. The same name twice in one file, such as one for
each system that the program is built for, is one definition.
"""

import argparse
import collections
import sys

from code_lines import KEYWORDS, end_of_group, sources_here, tokens_of

KINDS = frozenset(("struct", "enum", "trait", "union", "type"))


def types_of(text):
    """The names of the types that a source defines, with the line of each, counted from 1."""
    tokens = tokens_of(text)
    found, index = [], 0
    # Where the blocks of `impl` and `trait` end that `index` is in.
    inside = []
    while index < len(tokens):
        while inside and index >= inside[-1]:
            inside.pop()
        word = tokens[index].text
        following = tokens[index + 1] if index + 1 < len(tokens) else None
        if word == "macro_rules" and following is not None and following.text == "!":
            while index < len(tokens) and tokens[index].text not in ("{", "(", "["):
                index += 1
            index = end_of_group(tokens, index)
            continue
        if tokens[index].kind == "word" and following is not None and following.kind == "word":
            is_name = following.text not in KEYWORDS
            if word in KINDS and is_name and not (word == "type" and inside):
                found.append((following.text, following.first + 1))
        if word == "trait" or word == "impl" and is_item(tokens, index):
            start = block_of(tokens, index)
            if start is not None:
                inside.append(end_of_group(tokens, start))
        index += 1
    return found


def is_item(tokens, index):
    """Whether the `impl` at `index` is a block, and not the type of an argument or of what is returned."""
    before = tokens[index - 1].text if index > 0 else ";"
    return before in (";", "}", "{", "]", "unsafe", "default")


def block_of(tokens, index):
    """The index of the brace that opens the block of the `impl` or `trait` at `index`; `None` of a trait's alias."""
    while index < len(tokens):
        if tokens[index].text == "{":
            return index
        if tokens[index].text == ";":
            return None
        index = end_of_group(tokens, index) if tokens[index].text in ("(", "[") else index + 1
    return None


def repeated(sources):
    """Names of types with the places of their definitions, where these are in several files."""
    places = collections.defaultdict(list)
    for path, text in sorted(sources.items()):
        for name, line in types_of(text):
            places[name].append((path, line))
    return {name: each for name, each in sorted(places.items()) if len({path for path, _ in each}) > 1}


def self_test():
    """Checks of what is a definition, and of what is repeated."""

    def names(text):
        return [name for name, _ in types_of(text)]

    def same(found, expected):
        if found != expected:
            raise SystemExit(f"self-test: found {found!r}, expected {expected!r}")

    same(types_of("// struct No;\n\npub struct A;\nenum B { C }\n"), [("A", 3), ("B", 4)])
    same(names("pub(crate) unsafe trait A {}\nunion B { a: u8 }\npub type C<T> = Vec<T>;\n"), ["A", "B", "C"])
    # Associated types, and aliases behind them.
    same(names("impl<T> A for B<T> where [T; 2]: C { type Output = u8; }\ntype D = u8;\n"), ["D"])
    same(names("trait A { type Output; }\ntype B = u8;\nunsafe impl C for B { type Output = u8; }\n"), ["A", "B"])
    same(names("impl A { fn f() { struct Inner; } }\n"), ["Inner"])
    # An `impl` that is a type opens no block.
    same(names("fn f(a: impl Fn(u8)) -> impl B { 1 }\ntype C = u8;\n"), ["C"])
    same(names("mod a { struct B; type C = u8; }\n"), ["B", "C"])
    # Strings, macros and fields.
    same(names('const A: &str = "struct B;";\nmacro_rules! c { ($d:ident) => { struct $d; struct E; } }\nstruct F;\n'), ["F"])
    same(names("fn f(r#type: u8) { let union = r#type; g(union); }\nlet a = r#\"enum B\"#;\n"), [])

    one, two = "crates/a/src/lib.rs", "crates/b/src/lib.rs"
    same(repeated({one: "struct A;\nstruct B;\n", two: "struct B;\n"}), {"B": [(one, 2), (two, 1)]})
    same(repeated({one: "mod x { struct A; }\nmod y { struct A; }\n", two: "struct B;\n"}), {})
    print("self-test passed")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--self-test", action="store_true", help="check this script")
    if parser.parse_args().self_test:
        self_test()
        return
    found = repeated(sources_here())
    for name, places in found.items():
        print(name)
        for path, line in places:
            print(f"    {path}:{line}")
    if found:
        sys.exit(f"names of types that are defined in more than one file: {len(found)}")


if __name__ == "__main__":
    main()
