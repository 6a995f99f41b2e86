#!/usr/bin/env python3
"""Counts what exported filters take on emulated processors, and writes the table of the book.

    tools/source_costs.py target/debug/kalmems            writes book/src/figures/embedded_costs.md
    tools/source_costs.py target/debug/kalmems --check    fails if what `--cpu` says is more than a quarter away from a count

Each filter of the examples is exported in C and compiled by gcc -O2. Instructions are those of a step in the mean of 20, counted by QEMU. The stack is
that of a step with what it calls inside of the file, by the compiler, without functions of its library.

The emulator of Arm is that of a larger processor, which has the same instructions.

Needs arm-none-eabi-gcc, riscv64-unknown-elf-gcc, qemu-arm and qemu-riscv32.
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
TABLE = ROOT / "book/src/figures/embedded_costs.md"
FILTERS = [
    ("shared_scanner/microcontroller.toml", "Euler EKF"),
    ("shared_scanner/microcontroller.toml", "EKF"),
    ("shared_scanner/stiffness_state.toml", "EKF with stiffness"),
    ("accelerometer/experiment.toml", "Settled gain"),
    ("accelerometer/experiment.toml", "EKF"),
    ("piston_mirror/experiment.toml", "Five states"),
    ("comb_resonator/experiment.toml", "EKF"),
    ("tuning_fork/experiment.toml", "EKF"),
    ("thermal_mirror/experiment.toml", "EKF"),
    ("vibrating_gyroscope/experiment.toml", "EKF"),
]
ARM = "arm-none-eabi-gcc -mthumb"
PROCESSORS = {
    "cortex-m4f": (f"{ARM} -mcpu=cortex-m4 -mfloat-abi=hard -mfpu=fpv4-sp-d16", "qemu-arm -cpu max"),
    "cortex-m7": (f"{ARM} -mcpu=cortex-m7 -mfloat-abi=hard -mfpu=fpv5-d16", "qemu-arm -cpu max"),
    "cortex-m0plus": (f"{ARM} -mcpu=cortex-m0plus", "qemu-arm -cpu max"),
    "rv32imfc": ("riscv64-unknown-elf-gcc -march=rv32imfc -mabi=ilp32f", "qemu-riscv32 -cpu rv32"),
}
# How far an estimate may be from a count, as a part of it.
MOST = 0.25
# A program that takes steps and ends, without a library of C.
PROGRAM = """
#include "@name@_self_test.c"
static @name@_t filter;
void _start(void);
void *memcpy(void *to, const void *from, __SIZE_TYPE__ count);
void *memset(void *to, int value, __SIZE_TYPE__ count);
void *memcpy(void *to, const void *from, __SIZE_TYPE__ count)
{
    char *a = to;
    const char *b = from;
    for (; count > 0U; count--) {
        *a++ = *b++;
    }
    return to;
}
void *memset(void *to, int value, __SIZE_TYPE__ count)
{
    char *a = to;
    for (; count > 0U; count--) {
        *a++ = (char)value;
    }
    return to;
}
void _start(void)
{
    unsigned k;
#ifdef __riscv
    __asm volatile(".option push\\n.option norelax\\nla gp, __global_pointer$\\n.option pop");
#endif
    @name@_start(&filter);
    for (k = 0U; k < @steps@U; k++) {
        (void)@name@_step(&filter@given@);
    }
    {
#ifdef __riscv
        register long status __asm("a0") = 0, call __asm("a7") = 93;
        __asm volatile("ecall" : : "r"(status), "r"(call));
#else
        register long status __asm("r0") = 0;
        __asm volatile("push {r7}\\nmovs r7, #1\\nsvc 0\\npop {r7}" : : "r"(status));
#endif
    }
    for (;;) {
    }
}
"""


def run(*words, folder=None):
    """What a command prints; ends with its errors where it fails."""
    ran = subprocess.run(words, cwd=folder or ROOT, capture_output=True, text=True)
    if ran.returncode:
        sys.exit(f"{' '.join(map(str, words))}: {ran.stderr}")
    return ran.stdout


def executed(compiler, emulator, name, folder, given):
    """Instructions of a step in the mean of the steps 21 to 40."""
    counts = []
    for steps in (20, 40):
        program = PROGRAM.replace("@name@", name).replace("@steps@", str(steps)).replace("@given@", given)
        (folder / "count.c").write_text(program)
        flags = ["-std=gnu99", "-ffreestanding", "-O2", "-fno-tree-loop-distribute-patterns", "-nostdlib", "-nostartfiles"]
        run(*compiler.split(), *flags, "-o", "count", "count.c", f"{name}.c", "-lgcc", folder=folder)
        run(*emulator.split(), "-singlestep", "-d", "exec,nochain", "-D", "trace", "./count", folder=folder)
        with (folder / "trace").open() as trace:
            counts.append(sum(line.startswith("Trace") for line in trace))
        (folder / "trace").unlink()
    return round((counts[1] - counts[0]) / 20)


def stack(compiler, name, folder):
    """Bytes of text of the filter, and of the stack of its step with the deepest function that is no part of the interface."""
    run(*compiler.split(), "-std=c99", "-ffreestanding", "-O2", "-fstack-usage", "-c", f"{name}.c", folder=folder)
    tool = compiler.split()[0].replace("-gcc", "-size")
    sizes = run(tool, "-A", f"{name}.o", folder=folder)
    text = sum(int(size) for size in re.findall(r"^\.(?:text|rodata)\S*\s+(\d+)", sizes, re.M))
    usage = re.findall(r":(\w+)\s+(\d+)\s", (folder / f"{name}.su").read_text())
    own = max(int(size) for function, size in usage if function == f"{name}_step")
    inner = [int(size) for function, size in usage if not function.startswith(f"{name}_")]
    return text, own + max(inner, default=0)


def main():
    command, checks = pathlib.Path(sys.argv[1]).resolve(), "--check" in sys.argv
    rows, wrong = [], []
    for experiment, filter_name in FILTERS:
        cells = []
        for processor, (compiler, emulator) in PROCESSORS.items():
            with tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                export = ["export", f"examples/{experiment}", "--target", "c", "--filter", filter_name, "--samples", "60"]
                export += ["--cpu", processor, "--json", "--out", folder / "out"]
                said = json.loads(run(command, *export))
                folder = folder / "out"
                header = next(path for path in folder.glob("*.h") if "self_test" not in path.name)
                name = header.stem
                count = re.search(rf"int {name}_step\((.*?)\);", header.read_text(), re.S)[1].count("float ")
                given = "".join(f", GIVEN[k][{column}]" for column in range(count))
                found = executed(compiler, emulator, name, folder, given)
                text, depth = stack(compiler, name, folder)
                about = said["instructions"]
                if abs(about - found) > MOST * found:
                    wrong.append(f"{experiment}, {filter_name}, {processor}: {found} instructions, and `--cpu` says {about:.0f}")
                print(f"{experiment}, {filter_name}, {processor}: {found} instructions, about {about:.0f} said; {text} B, {depth} B", flush=True)
                cells += [f"{found}", f"{text}", f"{depth}"]
        rows.append([experiment.split("/")[0].replace("_", " "), filter_name, str(said["cost"]["bytes"]), *cells])
    if wrong:
        sys.exit("\n".join(wrong))
    if not checks:
        columns = ["device", "filter", "structure"]
        columns += [f"{processor}: {what}" for processor in PROCESSORS for what in ("instructions", "text", "stack")]
        lines = [columns, ["---", "---"] + ["--:"] * (len(columns) - 2), *rows]
        TABLE.write_text("".join(f"| {' | '.join(line)} |\n" for line in lines))


if __name__ == "__main__":
    main()
