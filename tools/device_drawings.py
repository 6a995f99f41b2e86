#!/usr/bin/env python3
"""Draws the five published devices with the symbols of the book and the keys of their experiment files: book/src/figures/device_NAME.svg.

    tools/device_drawings.py            draws them
    tools/device_drawings.py --check    fails if a picture is another one, or an example has no key that a drawing names
"""

import math
import re
import sys
import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FIGURES = ROOT / "book/src/figures"
WIDTH, HEIGHT = 900, 360
INK, GREY, BLUE, RED, FILL = "#222222", "#8a8a8a", "#1f5fa8", "#b3401c", "#e9eef5"
# Where the list of symbols begins.
LIST = 560


class Drawing:
    """A picture: a sketch at the left, and next to it the symbols with the keys that state them."""

    def __init__(self, name: str, title: str, symbols: list[tuple[str, str]]):
        self.name, self.title, self.symbols, self.parts = name, title, symbols, []
        self.text(20, 28, title, size=15)
        for place, (symbol, key) in enumerate(symbols):
            y = 62 + 24 * place
            self.text(LIST, y, symbol, size=14, colour=BLUE)
            self.text(LIST + 62, y, key, size=12.5, family="DejaVu Sans Mono, monospace" if "." in key else None)

    def add(self, part: str) -> None:
        self.parts.append(part)

    def line(self, *points: tuple[float, float], colour=INK, width=1.6, dash=None, closed=False, fill="none") -> None:
        path = "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + ("Z" if closed else "")
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self.add(f'<path d="{path}" fill="{fill}" stroke="{colour}" stroke-width="{width}"{dashed} stroke-linejoin="round"/>')

    def box(self, x, y, width, height, fill=FILL, colour=INK) -> None:
        self.line((x, y), (x + width, y), (x + width, y + height), (x, y + height), closed=True, fill=fill, colour=colour)

    def text(self, x, y, words, size=13.0, colour=INK, anchor="start", family=None) -> None:
        """A line of text; `_x` is a subscript of one or of braced letters. What has a subscript begins where its estimated width puts it."""
        own = f' font-family="{family}"' if family else ""
        if family or "_" not in words:
            self.add(f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{colour}" text-anchor="{anchor}"{own}>{escape(words)}</text>')
            return
        pieces = [(part.strip("{}"), place % 2) for place, part in enumerate(re.split(r"_(\{[^}]*\}|.)", words)) if part]
        width = sum(len(part) * size * (0.45 if low else 0.6) for part, low in pieces)
        x -= {"start": 0, "middle": width / 2, "end": width}[anchor]
        marked, lowered = "", 0
        for part, low in pieces:
            shift, small = 4 * (low - lowered), f' font-size="{0.72 * size:.1f}"' if low else ""
            marked, lowered = marked + f'<tspan dy="{shift}"{small}>{escape(part)}</tspan>', low
        self.add(f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size}" fill="{colour}">{marked}</text>')

    def symbol(self, x, y, words, anchor="middle") -> None:
        self.text(x, y, words, size=15, colour=BLUE, anchor=anchor)

    def arrow(self, start, end, colour=INK, both=False) -> None:
        self.line(start, end, colour=colour)
        for tip, back in [(end, start)] + ([(start, end)] if both else []):
            angle = math.atan2(tip[1] - back[1], tip[0] - back[0])
            wings = [(tip[0] - 8 * math.cos(angle + s), tip[1] - 8 * math.sin(angle + s)) for s in (0.4, -0.4)]
            self.line(wings[0], tip, wings[1], closed=True, fill=colour, colour=colour, width=0.8)

    def arc(self, centre, radius, begin, end, colour=BLUE) -> None:
        """An arc with an arrow at its end; angles in degrees, counted anticlockwise."""
        points = [begin + (end - begin) * k / 24 for k in range(25)]
        way = [(centre[0] + radius * math.cos(math.radians(a)), centre[1] - radius * math.sin(math.radians(a))) for a in points]
        self.line(*way, colour=colour, width=1.3)
        self.arrow(way[-2], way[-1], colour=colour)

    def spring(self, start, end, turns=6, width=8) -> None:
        (x1, y1), (x2, y2) = start, end
        length = math.hypot(x2 - x1, y2 - y1)
        along, across = ((x2 - x1) / length, (y2 - y1) / length), (-(y2 - y1) / length, (x2 - x1) / length)
        points = [start]
        for k in range(2 * turns):
            at = length * (0.15 + 0.7 * (k + 0.5) / (2 * turns))
            side = width if k % 2 else -width
            points.append((x1 + along[0] * at + across[0] * side, y1 + along[1] * at + across[1] * side))
        self.line(*points, end, width=1.4)

    def chain(self, y, blocks: list[str], begin=20, end=500) -> None:
        """Stages of a readout from left to right; the last is the output."""
        width = (end - begin - 26 * len(blocks)) / (len(blocks) - 0.45)
        x = begin
        for place, block in enumerate(blocks):
            if place == len(blocks) - 1:
                self.symbol(x + 6, y + 19, block, anchor="start")
                break
            self.box(x, y, width, 28)
            self.text(x + width / 2, y + 18, block, size=11.5, anchor="middle")
            self.arrow((x + width, y + 14), (x + width + 26, y + 14))
            x += width + 26

    def svg(self) -> str:
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" '
            f'aria-label="{escape(self.title)}" font-family="DejaVu Sans, Verdana, sans-serif">\n<rect width="{WIDTH}" height="{HEIGHT}" fill="#fff"/>\n'
        )
        return head + "\n".join(self.parts) + "\n</svg>\n"


def plate(drawing: Drawing, centre, length, tilt, thickness=9) -> None:
    """A plate that is turned about its middle by an angle in degrees."""
    c, s = math.cos(math.radians(tilt)), -math.sin(math.radians(tilt))
    corners = [(-length / 2, -thickness / 2), (length / 2, -thickness / 2), (length / 2, thickness / 2), (-length / 2, thickness / 2)]
    drawing.line(*[(centre[0] + c * x - s * y, centre[1] + s * x + c * y) for x, y in corners], closed=True, fill=FILL)


def torsion(drawing: Drawing, centre) -> None:
    x, y = centre
    drawing.add(f'<circle cx="{x}" cy="{y}" r="6" fill="#fff" stroke="{INK}" stroke-width="1.6"/>')


def fingers(drawing: Drawing, x, y, count, colour=INK) -> None:
    for k in range(count):
        drawing.line((x + 7 * k, y - 17), (x + 7 * k, y + 17), colour=colour, width=2.2)


def shared_scanner() -> Drawing:
    d = Drawing("shared_scanner", "Shared-electrode scanner: one comb drives the mirror and senses it", [
        ("θ", "angle, a state"),
        ("J", "resonator.inertia"), ("k", "resonator.stiffness"), ("b", "resonator.damping"),
        ("C_0", "comb.nominal_capacitance"), ("θ_0", "comb.angular_width"), ("C_b", "comb.bias_capacitance"),
        ("V", "drive, a channel"), ("V_c", "carrier.amplitude"),
        ("a", "readout.gain"), ("c", "readout.offset"), ("R", "readout.noise_variance"), ("y", "signal, a channel"),
    ])
    centre = (250, 150)
    d.line((70, 150), (430, 150), colour=GREY, dash="5 4", width=1.1)
    fingers(d, 68, 150, 6, GREY)
    fingers(d, 397, 150, 6, GREY)
    plate(d, centre, 330, 9)
    torsion(d, centre)
    d.arc(centre, 120, 0, 9)
    d.symbol(384, 136, "θ")
    d.symbol(250, 186, "J, k, b")
    d.text(250, 204, "torsion bar", size=11.5, anchor="middle", colour=GREY)
    d.symbol(88, 112, "C(θ) = C_0·exp(−θ²/θ₀²) + C_b", anchor="start")
    d.line((432, 168), (432, 232), (60, 232), width=1.3)
    d.line((60, 232), (60, 168), width=1.3)
    d.box(205, 220, 90, 24, fill="#fff")
    d.symbol(250, 237, "V + V_c")
    d.line((60, 232), (60, 284), width=1.3)
    d.chain(284, ["amplifier", "high-pass", "detector", "low-pass", "y = a·C(θ) + c"], begin=20, end=470)
    return d


def threshold_scanner() -> Drawing:
    d = Drawing("threshold_scanner", "Threshold-sensing scanner: a current that is zero at one angle", [
        ("θ", "angle, a state"),
        ("ω_0", "resonator.natural_frequency"), ("ζ", "resonator.damping_ratio"),
        ("θ_c", "comb.threshold_angle"), ("N_g", "comb.gain"), ("N_θ", "comb.steepness"),
        ("R_s", "readout.feedback_resistance"), ("V_b", "readout.bias"), ("y_0", "readout.offset"),
        ("C_{ft}", "readout.feedthrough_capacitance"), ("R", "readout.noise_variance"), ("y", "signal, a channel"),
    ])
    centre = (230, 160)
    d.line((60, 160), (430, 160), colour=GREY, dash="5 4", width=1.1)
    plate(d, centre, 300, 14)
    torsion(d, centre)
    t = math.radians(5)
    d.line(centre, (230 + 190 * math.cos(t), 160 - 190 * math.sin(t)), colour=RED, dash="7 4", width=1.4)
    fingers(d, 392, 146, 5, RED)
    d.arc(centre, 100, 0, 14)
    d.symbol(316, 128, "θ")
    d.symbol(452, 144, "θ_c")
    d.text(392, 186, "sensing comb", size=11.5, colour=GREY, anchor="middle")
    fingers(d, 56, 160, 5, GREY)
    d.text(72, 132, "driving comb", size=11.5, colour=GREY, anchor="middle")
    d.symbol(230, 200, "ω_0, ζ")
    d.symbol(52, 232, "V", anchor="middle")
    d.line((52, 216), (52, 180), width=1.3)
    d.line((428, 162), (470, 162), (470, 232), (355, 232), (355, 262), width=1.3)
    d.chain(262, ["bias V_b", "current · R_s", "y"], begin=180, end=480)
    d.line((62, 232), (150, 232), width=1.1, dash="3 3", colour=GREY)
    d.line((150, 232), (150, 276), (180, 276), width=1.1, dash="3 3", colour=GREY)
    d.symbol(108, 224, "C_{ft}")
    d.text(20, 316, "y = h(θ)·dθ/dt + y_0", size=14, colour=BLUE)
    d.text(20, 340, "h(θ) = N_g·(1/(1 + exp(−N_θ(θ − θ_c))) − ½)", size=14, colour=BLUE)
    return d


def micro_stage() -> Drawing:
    d = Drawing("micro_stage", "Micro-stage: four stators under a stage that turns an instrument", [
        ("θ", "angle, a state, with its rate"),
        ("ω_0", "resonator.natural_frequency"), ("ζ", "resonator.damping_ratio"), ("b_c", "resonator.drive_gain"),
        ("w_1", "electrodes.1A.w1, w2 across"), ("w_3", "electrodes.1A.w3, w4 along"),
        ("D", "electrodes.1A.gap"), ("η", "electrodes.1A.gain"), ("R", "electrodes.1A.noise_variance"),
        ("V", "drive, a channel"), ("y", "a signal of each stator"),
    ])
    centre, scale = (270, 130), 145
    d.line((50, 130), (500, 130), colour=GREY, dash="5 4", width=1.1)
    plate(d, centre, 430, 5, 10)
    torsion(d, centre)
    d.box(240, 84, 60, 34, fill="#fff")
    d.text(270, 105, "gyroscope", size=10.5, anchor="middle")
    d.arc(centre, 170, 0, 5)
    d.symbol(458, 124, "θ")
    for name, begin, end in [("1A", -1.39, -0.99), ("2B", -0.795, -0.475), ("1B", 0.475, 0.795), ("2A", 0.99, 1.39)]:
        d.box(centre[0] + scale * begin, 196, scale * (end - begin), 9)
        d.text(centre[0] + scale * (begin + end) / 2, 222, name, size=12, anchor="middle")
    d.line((270, 136), (270, 250), colour=GREY, dash="2 4", width=1.1)
    d.text(276, 250, "axis", size=11.5, colour=GREY)
    d.arrow((88, 134), (88, 196), both=True)
    d.symbol(76, 168, "D")
    d.arrow((270, 240), (414, 240), colour=BLUE)
    d.symbol(340, 256, "w_1")
    d.arrow((270, 272), (471, 272), colour=BLUE)
    d.symbol(380, 288, "w_2")
    d.symbol(200, 168, "ω_0, ζ")
    d.text(20, 262, "drive: d²θ/dt² = … + b_c·V", size=14, colour=BLUE)
    d.text(20, 334, "y = η·(∂C/∂θ)·dθ/dt,   C = ε(w_4 − w_3)·∫dw/(D − w·tan θ) from w_1 to w_2", size=13, colour=BLUE)
    return d


def accelerometer() -> Drawing:
    d = Drawing("accelerometer", "Force-rebalance accelerometer: plates sense the proof mass and push it back", [
        ("x", "displacement, a state"), ("a", "acceleration, a state"),
        ("m", "proof_mass.mass"), ("k", "proof_mass.spring"), ("b", "proof_mass.damping"), ("T", "proof_mass.temperature"),
        ("A", "plates.area"), ("d_0", "plates.gap"), ("ε_r", "plates.relative_permittivity"),
        ("V_1", "readout.carrier_amplitude"), ("C_4", "readout.feedback_capacitance"),
        ("V_B", "feedback.bias"), ("v_F", "feedback, a channel"),
    ])
    d.box(250, 90, 60, 120)
    d.symbol(280, 156, "m")
    for x in (196, 356):
        d.line((x, 80), (x, 220), width=5)
    d.arrow((201, 106), (248, 106), both=True)
    d.symbol(225, 98, "d_0")
    d.arrow((312, 106), (351, 106), both=True)
    d.symbol(332, 98, "d_0")
    d.line((40, 70), (40, 230), width=2.4)
    for y in range(76, 230, 14):
        d.line((40, y), (30, y + 10), width=1)
    d.spring((40, 132), (250, 132), turns=9)
    d.symbol(108, 118, "k")
    d.line((40, 178), (110, 178), width=1.4)
    d.line((118, 166), (110, 166), (110, 190), (118, 190), width=1.4)
    d.line((114, 178), (250, 178), width=1.4)
    d.line((114, 169), (114, 187), width=2.2)
    d.symbol(108, 208, "b")
    d.arrow((280, 66), (318, 66), colour=RED)
    d.symbol(300, 58, "x")
    d.arrow((400, 150), (450, 150), colour=RED)
    d.symbol(462, 155, "a")
    d.line((196, 220), (196, 246), width=1.3)
    d.line((356, 220), (356, 246), width=1.3)
    d.symbol(172, 262, "V_1, V_B − v_F")
    d.symbol(384, 262, "V_1, V_B + v_F")
    d.line((280, 210), (280, 290), width=1.3)
    d.chain(290, ["amplifier C_4", "demodulator", "y"], begin=190, end=560)
    d.text(20, 306, "force −g·v_F", size=13, colour=BLUE)
    d.text(20, 326, "g = 2εAV_B/d_0²", size=13, colour=BLUE)
    return d


def piston_mirror() -> Drawing:
    d = Drawing("piston_mirror", "Piston mirror: a capacitance to one electrode shows the distance", [
        ("d", "position, the answer"), ("d_0", "offset, a state"), ("A", "amplitude, a state"), ("φ", "phase, a state"), ("f", "frequency, a state"),
        ("c_k", "capacitance.coefficients"), ("d_r", "capacitance.reference_distance"),
        ("S", "readout.noise_density"), ("C", "signal, a channel"),
    ])
    d.box(150, 90, 190, 12)
    d.text(245, 82, "mirror", size=12, anchor="middle")
    d.line((110, 150), (380, 150), colour=GREY, dash="5 4", width=1.1)
    d.text(384, 154, "rest", size=11.5, colour=GREY)
    d.arrow((360, 110), (360, 190), colour=RED, both=True)
    d.symbol(378, 130, "±A", anchor="start")
    d.line((120, 96), (150, 96), width=1.3)
    d.line((340, 96), (372, 96), width=1.3)
    d.spring((120, 96), (60, 96), turns=4)
    d.spring((372, 96), (432, 96), turns=4)
    d.line((60, 70), (60, 124), width=2.4)
    d.line((432, 70), (432, 124), width=2.4)
    d.box(170, 246, 150, 10)
    d.text(245, 274, "electrode", size=12, anchor="middle")
    d.arrow((130, 102), (130, 246), both=True)
    d.symbol(118, 184, "d")
    d.arrow((215, 150), (215, 246), colour=GREY, both=True)
    d.symbol(232, 206, "d_0")
    d.symbol(285, 206, "C(d)")
    d.text(20, 312, "d = d_0 + A·cos φ,   dφ/dt = 2πf", size=14, colour=BLUE)
    d.text(20, 338, "C(d) = Σ c_k·(d_r/d)ᵏ", size=14, colour=BLUE)
    return d


DRAWINGS = [shared_scanner, threshold_scanner, micro_stage, accelerometer, piston_mirror]


def known_keys(device: str) -> set[str]:
    """The keys below the device's table in the files of its example."""
    found = set()

    def walk(table: dict, path: str) -> None:
        for key, value in table.items():
            found.add(f"{path}{key}")
            if isinstance(value, dict):
                walk(value, f"{path}{key}.")

    for file in (ROOT / "examples" / device).glob("*.toml"):
        walk(tomllib.loads(file.read_text(encoding="utf-8")).get("device", {}).get(device, {}), "")
    return found


def main() -> int:
    faults = []
    for make in DRAWINGS:
        drawing = make()
        keys = known_keys(drawing.name)
        named = [key.split(":")[0].split(",")[0] for _, key in drawing.symbols if "." in key]
        faults += [f"no example of {drawing.name} has the key {key}" for key in named if key not in keys]
        file = FIGURES / f"device_{drawing.name}.svg"
        if "--check" not in sys.argv[1:]:
            file.write_text(drawing.svg(), encoding="utf-8")
        elif file.read_text(encoding="utf-8") != drawing.svg():
            faults.append(f"{file.relative_to(ROOT)} is another picture: run tools/device_drawings.py")
    print("\n".join(faults), file=sys.stderr, end="\n" if faults else "")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
