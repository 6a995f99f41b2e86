#!/usr/bin/env python3
"""Prints the numbers of src/math/constants.rs, in f64 and in f32: polynomials with the error of what is printed, and
constants in parts.

Remez's exchange for weighted linear minimax approximation, in 60 digits (needs mpmath). Each polynomial q replaces
the tail of a series, and the weight is the tail's share of the function, so that the error is the function's own:

    exp    (e^r - 1 - r)/r^2            on |r| <= ln 2/2
    atanh  (atanh(s)/s - 1)/s^2         in z = s^2, |s| <= tanh((1 + 0.0861) ln 2/2)
    sin    (sin r - r)/r^3              in z = r^2, |r| <= pi/4
    cos    (cos r - 1 + r^2/2)/r^4      in z = r^2, |r| <= pi/4

All but the last part of a constant have so few bits that their products with the multiples that occur are exact.
"""

import struct
from mpmath import mp, mpf, atanh, cos, exp, log, lu_solve, matrix, pi, sin, tanh

mp.dps = 60
WIDER = mpf(1) + mpf(2) ** -12  # room for the rounding of the reduction


def series(f, x, taylor):
    """f(x), or its Taylor series where f loses digits."""
    return taylor(x) if abs(x) < mpf(10) ** -8 else f(x)


def exp_tail(r):
    return series(lambda r: (exp(r) - 1 - r) / r**2, r, lambda r: mpf(1) / 2 + r / 6 + r**2 / 24)


def atanh_tail(z):
    s = mp.sqrt(z)
    return series(lambda _: (atanh(s) / s - 1) / z, z, lambda z: mpf(1) / 3 + z / 5 + z**2 / 7)


def sin_tail(z):
    r = mp.sqrt(z)
    return series(lambda _: (sin(r) - r) / (r * z), z, lambda z: -mpf(1) / 6 + z / 120 - z**2 / 5040)


def cos_tail(z):
    r = mp.sqrt(z)
    return series(lambda _: (cos(r) - 1 + z / 2) / z**2, z, lambda z: mpf(1) / 24 - z / 720 + z**2 / 40320)


def sinc(z):
    return sin(mp.sqrt(z)) / mp.sqrt(z) if z > 0 else mpf(1)


S = tanh((1 + mpf("0.0861")) * log(2) / 2) * WIDER
PROBLEMS = {
    "EXP": (exp_tail, lambda r: r**2 / exp(r), -log(2) / 2 * WIDER, log(2) / 2 * WIDER, {"f64": 10, "f32": 5}),
    "ATANH": (atanh_tail, lambda z: z / (1 + z * atanh_tail(z)), mpf(0), S**2, {"f64": 11, "f32": 5}),
    "SIN": (sin_tail, lambda z: z / sinc(z), mpf(0), (pi / 4 * WIDER) ** 2, {"f64": 6, "f32": 4}),
    "COS": (cos_tail, lambda z: z**2 / cos(mp.sqrt(z)), mpf(0), (pi / 4 * WIDER) ** 2, {"f64": 6, "f32": 3}),
}


def value(c, x):
    total = mpf(0)
    for a in reversed(c):
        total = total * x + a
    return total


def remez(f, w, low, high, n):
    """The n coefficients, lowest first, that make the largest |w·(f - q)| least."""
    middle, half = (low + high) / 2, (high - low) / 2
    points = [middle - half * cos(pi * (2 * i + 1) / (2 * (n + 1))) for i in range(n + 1)]
    points = [x if w(x) > mpf(10) ** -9 else x + half / 50 for x in points]
    grid = [middle - half * cos(pi * i / 600) for i in range(601)]
    known = [(x, f(x), w(x)) for x in grid]
    for _ in range(12):
        a, b = matrix(n + 1, n + 1), matrix(n + 1, 1)
        for i, x in enumerate(points):
            for k in range(n):
                a[i, k] = x**k
            a[i, n] = (-1) ** i / w(x)
            b[i] = f(x)
        c = list(lu_solve(a, b))[:n]
        errors = [(x, (y - value(c, x)) * v) for x, y, v in known if v != 0]
        peaks = []
        for x, e in errors:  # the largest of each run of one sign
            if peaks and (peaks[-1][1] > 0) == (e > 0):
                if abs(e) > abs(peaks[-1][1]):
                    peaks[-1] = (x, e)
            else:
                peaks.append((x, e))
        while len(peaks) > n + 1:
            peaks.pop(0 if abs(peaks[0][1]) < abs(peaks[-1][1]) else -1)
        if len(peaks) < n + 1:
            break
        points = [x for x, _ in peaks]
    return c


def rounded(c, kind):
    if kind == "f64":
        return [float(a) for a in c]
    return [struct.unpack("f", struct.pack("f", float(a)))[0] for a in c]


def parts(x, bits, kind):
    """x as a sum of truncated parts of these sizes and a rounded rest."""
    result = []
    for n in bits:
        scale = mpf(2) ** (n - 1 - mp.floor(mp.log(x, 2)))
        part = mp.floor(x * scale) / scale
        result.append(part)
        x -= part
    return rounded(result + [x], kind)


def show(numbers, kind):
    for a in numbers:
        print(f"    {a!r}" if kind == "f64" else f"    {a:.9g}")


for name, (f, w, low, high, sizes) in PROBLEMS.items():
    for kind, n in sizes.items():
        c = rounded(remez(f, w, low, high, n), kind)
        grid = [low + (high - low) * i / 2000 for i in range(2001)]
        error = max(abs((f(x) - value([mpf(a) for a in c], x)) * w(x)) for x in grid)
        print(f"{name} {kind}: relative error 2^{float(mp.log(error, 2)):.1f}")
        show(c, kind)
for kind, ln2_bits, pi_bits in [("f64", [42], [33, 33]), ("f32", [16], [12, 12, 12])]:
    print(f"{kind}: ln 2, ln 2/2 and pi/2 in parts, 1/ln 2, 2/pi")
    show(parts(log(2), ln2_bits, kind) + parts(log(2) / 2, ln2_bits, kind) + parts(pi / 2, pi_bits, kind), kind)
    show(rounded([1 / log(2), 2 / pi], kind), kind)
