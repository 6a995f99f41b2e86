#!/usr/bin/env python3
"""How many samples `kalmems stream` estimates in a second, and how late its estimates are, each against a program that only copies.

    tools/stream_speed.py target/release/kalmems [--samples 3000000] [--paced 20000] [--rate 5000] [--rounds 7]

Every sample of the scanner's example comes as a frame and its estimate goes out as a frame, by one extended Kalman filter of two states and by the example
as it is shipped. A copy of the same bytes by Python, in the same run and over the same kinds of connection, is what all numbers are compared with.
Times of single samples are measured in rounds, the copy and the filter by turns, since a machine that does something else for a moment
makes the slowest of a hundred samples slow: of each quantile the median of the rounds is printed, with the smallest and the largest.
The program runs on one core where `taskset` is there. Both filters are also printed as times the copy's. Fails where the filter of two states takes more
than 1 us of its core for a sample, or its 99 % are more than 100 us above the copy's. Standard library alone."""

import argparse
import os
import shutil
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "examples" / "shared_scanner"
TEXT = '[stream.input.text]\ncolumns = ["time_s", "drive_V", "cap_V"]'
FRAMES = '[stream.input.frames]\nsync = "a55a"\nfields = ["f64 time_s", "f32 drive_V", "f32 cap_V"]'
COPY = "import os,sys,socket\ns=socket.create_connection(('127.0.0.1',int(sys.argv[1])))\nwhile b:=s.recv(65536): os.write(1,b)"
# Notes when how many bytes came, on its own, so that the sender does not hold it up.
READ = "import os,time\ng=[]\nwhile b:=os.read(0,65536): g.append((time.perf_counter(),len(b)))\nprint(*(f'{t} {n}' for t,n in g),sep='\\n')"
# Rows of the recording that are whole periods of its drive, so that it can be repeated.
PERIOD = 20_000
# Of so many samples the times are not longer than what is printed.
SHARES = (0.5, 0.9, 0.99, 0.999)


def experiments(folder):
    """One filter of two states, and the example with all that it has."""
    shipped = (EXAMPLE / "stream.toml").read_text().replace(TEXT, FRAMES).replace("every = 10 ", "every = 1 ")
    lines = [line for line in shipped.split("\n") if not line.startswith(("phase =", "states =", "smooth_lag =", "ahead =", "[stream.trigger]"))]
    # Without the stiffness as a state, the filter has the true one and follows the motion closely.
    one = "\n".join(lines).replace("1.1033e-4 N m", "1.10e-4 N m").replace("1e4 rad^2/s^3", "1e8 rad^2/s^3")
    for name, text in (("one EKF of two states", one), ("the shipped example", shipped)):
        path = folder / f"{name.replace(' ', '_')}.toml"
        path.write_text(text)
        yield name, path


def samples(count):
    rows = [line.split(",") for line in (EXAMPLE / "recording.csv").read_text().split("\n")[1:] if line]
    values = [(float(drive), float(signal)) for _, drive, signal in rows[:PERIOD]]
    pack = struct.Struct("<2sdff").pack
    return [pack(b"\xa5\x5a", k * 1e-6, *values[k % PERIOD]) for k in range(count)]


def on_one_core(command):
    return (["taskset", "-c", "0"] if shutil.which("taskset") else []) + command


def start(command, listener, out):
    process = subprocess.Popen(on_one_core(command), stdout=out, stderr=subprocess.PIPE)
    connection, _ = listener.accept()
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return process, connection


def sustained(command, listener, data):
    """Samples in a second of the processor's time and of the clock's, from the first byte to the end."""
    process, connection = start(command, listener, subprocess.DEVNULL)
    begun, before = time.perf_counter(), os.times().children_user + os.times().children_system
    connection.sendall(data)
    connection.close()
    process.communicate()
    after = os.times().children_user + os.times().children_system
    return time.perf_counter() - begun, after - before


def latencies(command, listener, frames, rate, size, waits):
    """Times in s from the sending of a sample to the frame that it completes, of samples that are sent at a rate."""
    into, out = os.pipe()
    reader = subprocess.Popen([sys.executable, "-c", READ], stdin=into, stdout=subprocess.PIPE, text=True)
    os.close(into)
    process, connection = start(command, listener, out)
    os.close(out)
    # The settling time at once: what is late is judged behind it.
    head = 9000
    connection.sendall(b"".join(frames[:head]))
    time.sleep(1.0)
    sent = []
    begun = time.perf_counter()
    for k, frame in enumerate(frames[head:]):
        time.sleep(max(begun + k / rate - time.perf_counter(), 0))
        sent.append(time.perf_counter())
        connection.sendall(frame)
    time.sleep(0.2)
    connection.sendall(b"# end\n")
    connection.close()
    process.communicate()
    came, total = [], 0
    for line in reader.communicate()[0].splitlines():
        when, count = line.split()
        total += int(count)
        came.extend([float(when)] * (total // size - len(came)))
    pairs = [(sent[k - head], came[k - waits]) for k in range(head, len(frames)) if k - waits < len(came)]
    return sorted(after - before for before, after in pairs)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("kalmems", type=Path)
    arguments.add_argument("--samples", type=int, default=3_000_000)
    arguments.add_argument("--paced", type=int, default=20_000)
    arguments.add_argument("--rate", type=float, default=5000.0)
    arguments.add_argument("--rounds", type=int, default=7)
    given = arguments.parse_args()
    binary = str(given.kalmems.resolve())
    listener = socket.create_server(("127.0.0.1", 0))
    port = listener.getsockname()[1]
    copy = [sys.executable, "-c", COPY, str(port)]
    frames = samples(max(given.samples, given.paced + 9000))
    data = b"".join(frames[: given.samples]) + b"# end\n"
    with tempfile.TemporaryDirectory() as folder:
        found = list(experiments(Path(folder)))
        stream = lambda path: [binary, "stream", str(path), "--from", f"tcp://127.0.0.1:{port}", "--frames", "-"]
        print(f"{given.samples} samples as fast as they are taken, in s of the clock and of the processor")
        work = []
        for name, command in [("copy", copy)] + [(name, stream(path)) for name, path in found]:
            clock_s, work_s = sustained(command, listener, data)
            work.append(work_s)
            ratio = f"{work_s / work[0]:6.1f} times the copy's"
            print(f"  {name:24} {clock_s:7.2f} {work_s:7.2f}   {given.samples / clock_s / 1e6:6.2f} M samples/s, {ratio}")
        print(
            f"{given.rounds} times {given.paced} samples at {given.rate:.0f} Hz: from sending to the frame that it completes, in us, "
            "median (smallest to largest) of the rounds"
        )
        paced = frames[: given.paced + 9000]
        size = len(frames[0])
        programs = [("copy", copy, size, 0)] + [(name, stream(path), 8 + 8 * 5, 2) for name, path in found[:1]]
        measured = {name: [] for name, *_ in programs}
        for _ in range(given.rounds):
            for name, command, size, waits in programs:
                times = latencies(command, listener, paced, given.rate, size, waits)
                measured[name].append([1e6 * times[min(int(share * len(times)), len(times) - 1)] for share in SHARES])
        medians = {name: [median(column) for column in zip(*rounds)] for name, rounds in measured.items()}
        for name, rounds in measured.items():
            columns = [sorted(column) for column in zip(*rounds)]
            texts = [f"{median(c):.0f} ({c[0]:.0f} to {c[-1]:.0f})" for c in columns]
            print(f"  {name:24} " + "   ".join(f"{100 * share:g} % {text}" for share, text in zip(SHARES, texts)))
        late = [own - copied for own, copied in zip(medians[found[0][0]], medians["copy"])]
        print("  above the copy           " + "   ".join(f"{100 * share:g} % {us:.0f}" for share, us in zip(SHARES, late)))
        each_us = 1e6 * work[1] / given.samples
        print(f"{found[0][0]}: {each_us:.2f} us of its core for a sample (at most 1), 99 % within {late[2]:.0f} us more than the copy (at most 100)")
        sys.exit(each_us > 1.0 or late[2] > 100.0)


if __name__ == "__main__":
    main()
