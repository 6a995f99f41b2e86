#!/usr/bin/env python3
"""Whether a number of a file can hold a command: every number of every example, one at a time, replaced by ones that nobody means.

    tools/extreme_numbers.py target/release/kalmems [--only PART] [--commands estimate,simulate,study,stream,compare] [--seconds 10]

Experiments, simulations, studies and streams of examples/ run on the first 3000 rows of their recordings, or over 2 ms, with one number of their file
replaced; `compare` on two results, with one number of `run.toml` or `metrics.json` replaced. Each run may take 10 s of the processor more than five times
the one without a replaced number, with 2 GB of memory, and ends with one of the command's own exit codes. Prints what did not and fails then.
Standard library alone."""

import argparse
import math
import re
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NUMBER = re.compile(r"(?<![\w.#-])[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?(?![\w.:])")
EXTREMES = ("9223372036854775807", "9e18", "1e-300")
ROWS = 3000
MEMORY = 2 << 30
# What the command says of its end: done, wrong, misused, doubtful under --strict, and those of a stream.
CODES = range(7)
COMMANDS = {
    "estimate": ("[estimate", ["estimate", "FILE", "--quiet", "--force", "--out", "out"]),
    "simulate": ("[simulate", ["simulate", "FILE", "--quiet", "--force", "--out", "out"]),
    "study": ("[[vary", ["study", "FILE", "--threads", "1", "--quiet", "--force", "--out", "out"]),
    "stream": ("[stream", ["stream", "FILE", "--from", "recording.csv", "--quiet", "--force", "--lines", "lines.txt"]),
}


def short(text):
    """A file of an example whose work is soon done."""
    for key, value in (("skip", '"0 s"'), ("duration", '"2 ms"')):
        text = re.sub(rf"(?m)^{key} = .*$", f"{key} = {value}", text)
    if "[[vary" in text:
        text = re.sub(r"points = \d+", "points = 2", re.sub(r"repeats = \d+", "repeats = 1", text))
    return text


def copied(folder, to):
    for file in folder.iterdir():
        if file.suffix == ".csv":
            with open(file, errors="replace") as rows, open(to / file.name, "w") as some:
                some.writelines(line for line, _ in zip(rows, range(ROWS + 1)))
        elif file.suffix == ".toml":
            (to / file.name).write_text(short(file.read_text()))


def spans(text):
    """Where the numbers of a file are, without those of comments, names and descriptions."""
    at = 0
    for line in text.splitlines(True):
        if not line.lstrip().startswith(("#", "name", "description")):
            body = line.split(" # ")[0]
            yield from ((at + found.start(), at + found.end()) for found in NUMBER.finditer(body))
        at += len(line)


def run(command, folder, most_s):
    """How a command ends, within so much time of the processor, how much it took, and what it said."""
    seconds = math.ceil(most_s)

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))

    worked = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
    before = worked()
    # One that only waits takes no time of the processor.
    try:
        ended = subprocess.run(command, cwd=folder, capture_output=True, timeout=20 * seconds, preexec_fn=limit)
    except subprocess.TimeoutExpired:
        return None, most_s, ""
    return ended.returncode, worked() - before, ended.stderr.decode(errors="replace")[-300:]


def tried(what, command, folder, path, seconds):
    """Replaces each number of a file in turn; how many runs ended how, and what held the command."""
    text = path.read_text()
    code, usual_s, said = run(command, folder, 300)
    if code not in (0, 3, 6):
        print(f"{what}: passed over: without a replaced number it ends with {code}: {said.strip()}", flush=True)
        return []
    codes, held = Counter(), []
    for start, end in spans(text):
        for extreme in EXTREMES:
            path.write_text(text[:start] + extreme + text[end:])
            code, _, said = run(command, folder, seconds + 5 * usual_s)
            codes[code] += 1
            if code not in CODES:
                number = text.count("\n", 0, start)
                held.append(f"{what}:{number + 1}: {text.splitlines()[number].strip()[:120]} -> {extreme}: {code} {said}")
    path.write_text(text)
    print(f"{what}: {sum(codes.values())} runs, by exit codes {dict(codes)}", flush=True)
    for line in held:
        print(f"  {line}", flush=True)
    return held


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("kalmems", type=Path)
    arguments.add_argument("--only", default="")
    arguments.add_argument("--commands", default="estimate,simulate,study,stream,compare")
    arguments.add_argument("--seconds", type=float, default=10.0)
    given = arguments.parse_args()
    binary, wanted = str(given.kalmems.resolve()), given.commands.split(",")
    held = []
    for file in sorted((ROOT / "examples").glob("*/*.toml")):
        for name, (table, command) in COMMANDS.items():
            what = f"{name} {file.relative_to(ROOT / 'examples')}"
            text = file.read_text()
            is_whole = "experiment =" in text if name == "study" else name != "estimate" or "file =" in text
            if name not in wanted or table not in text or not is_whole or given.only not in what:
                continue
            with tempfile.TemporaryDirectory() as place:
                folder = Path(place)
                copied(file.parent, folder)
                own = [binary] + [file.name if part == "FILE" else part for part in command]
                held += tried(what, own, folder, folder / file.name, given.seconds)
    if "compare" in wanted and given.only in "compare":
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            copied(ROOT / "examples/shared_scanner", folder)
            for out in ("one", "other"):
                subprocess.run([binary, "estimate", "experiment.toml", "--quiet", "--out", out], cwd=folder, check=True, capture_output=True)
            for name in ("run.toml", "metrics.json"):
                held += tried(f"compare {name}", [binary, "compare", "one", "other"], folder, folder / "one" / name, given.seconds)
    print(f"{len(held)} numbers held a command")
    sys.exit(bool(held))


if __name__ == "__main__":
    main()
