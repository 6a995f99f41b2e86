"""Models of filters as equations in text and as expressions of SymPy, against the same models as functions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from kalmems import filters

TEXT = """
[states]
x = "mm"
v = "m/s"
[inputs]
force = "mN"
[parameters]
m = "20 g"
k = "3 N/m"
b = "0.1 N s/m"
[derivative]
x = "v"
v = "(force - b*v - k*x)/m"
[measure]
signal = "2[V/mm]*x + 0.5[V/mm^2]*x^2 in mV"
[noise]
v = "0.02[m^2/s^3]"
signal = "4e-3[V^2]"
"""
A, B = np.array([[0.0, 1.0], [-150.0, -5.0]]), np.array([[0.0], [50.0]])
"""The same in SI: 3 N/m over 20 g, 0.1 N s/m over 20 g, 1 over 20 g."""


def by_hand(x: Any) -> Any:
    """V of m."""
    return 2e3 * x[0] + 0.5e6 * x[0] ** 2


def test_equations_with_units_are_the_system_in_si() -> None:
    pytest.importorskip("scipy")
    model = filters.Equations(TEXT, 2e-3)
    exact = filters.from_state_space((A, B, [[1, 0]]), interval=2e-3, density=[0, 0.02])
    x, u = np.array([1e-3, 0.2]), np.array([0.003])
    assert np.allclose(model.f(x, u), exact["F"] @ x + exact["B"] @ u, rtol=1e-11)
    assert np.allclose(model.F(x, u), exact["F"], rtol=1e-11, atol=1e-13)
    assert np.allclose(model.h(x, u), [by_hand(x)], rtol=1e-13)
    assert np.allclose(model.H(x, u), [[2e3 + 1e6 * x[0], 0]], rtol=1e-12)
    q, r = model.noise([0, 0])
    assert np.allclose(q, exact["Q"], rtol=1e-6) and np.allclose(r, [[4e-3]])
    assert model.states == {"x": "mm", "v": "m/s"} and model.inputs == {"force": "mN"} and model.measurements == {"signal": "mV"}
    assert model.values == pytest.approx({"m": 0.02, "k": 3, "b": 0.1})
    assert repr(model) == "Equations(x in mm, v in m/s; force in mN -> signal in mV, every 0.002 s)"


def test_filters_take_equations() -> None:
    pytest.importorskip("scipy")
    model = filters.Equations(TEXT, 2e-3, values={"k": 2.0})
    exact = filters.from_state_space(([[0, 1], [-100, -5]], B, [[1, 0]]), interval=2e-3)
    random = np.random.default_rng(1)
    u = 0.01 * np.sin(0.02 * np.arange(400))[:, None]
    x, z = np.zeros(2), []
    for k in range(400):
        z.append(by_hand(x) + random.normal(0, 0.06))
        x = exact["F"] @ x + exact["B"] @ u[k]
    parts = model.parts([0, 0])
    functions = {"f": lambda x, u: exact["F"] @ x + exact["B"] @ u, "h": lambda x, u: np.array([by_hand(x)]), "Q": parts["Q"], "R": parts["R"]}
    start = ([0, 0], np.diag([1e-7, 1e-3]))
    found = filters.Ekf(**parts).run(z, *start, u)
    assert np.allclose(found.x, filters.Ekf(**functions).run(z, *start, u).x, atol=1e-8)
    points = filters.Ukf(parts["f"], parts["h"], Q=parts["Q"], R=parts["R"]).run(z, *start, u)
    assert np.allclose(points.x, filters.Ukf(**functions).run(z, *start, u).x, atol=1e-9)
    many = filters.Particles(parts["f"], parts["h"], Q=parts["Q"], R=parts["R"], members=200).run(z[:20], *start, u[:20])
    assert np.isfinite(many.x).all()
    fitted = filters.likelihood(lambda k: {**filters.Equations(TEXT, 2e-3, values={"k": k}).parts([0, 0]), "x0": start[0], "P0": start[1]}, {"k": 2.0}, z, u)
    assert fitted([2.0]) > max(fitted([1.8]), fitted([2.2]))


@pytest.mark.parametrize(
    ("call", "kind", "mend"),
    [
        (lambda: filters.Equations(TEXT.replace("b*v", "b*w"), 1e-3), ValueError, "`w` is not defined"),
        (lambda: filters.Equations(TEXT.replace('v = "(force', 'v = "(x + force'), 1e-3), ValueError, "derivative.v"),
        (lambda: filters.Equations(TEXT, 1e-3, values={"kk": 1}), KeyError, "no parameter is called `kk`; there are m, k, b"),
        (lambda: filters.Equations(TEXT, 0), ValueError, "expected seconds above 0"),
        (lambda: filters.Equations(5, 1), TypeError, "or use `symbolic` for SymPy"),  # type: ignore[arg-type]
        (lambda: filters.Equations(TEXT, 1e-3).f([0, 0]), ValueError, "`u` has 0 numbers; the equations have 1"),
        (lambda: filters.Equations(TEXT, 1e-3).h([0], [0]), ValueError, "`x` has 1 numbers; the equations have 2"),
        (
            lambda: filters.Equations(TEXT + '[when]\nstop = { falls = "x", set = { v = "-v" } }\n', 1e-3),
            ValueError,
            "`when` sets states at once, which these filters do not follow",
        ),
    ],
)
def test_equations_that_cannot_be_followed_are_refused(call: Any, kind: type[Exception], mend: str) -> None:
    with pytest.raises(kind, match=mend.replace("(", r"\(")):
        call()


@pytest.mark.parametrize("compiled", [False, True])
def test_expressions_are_the_functions_that_they_say(compiled: bool) -> None:
    sympy = pytest.importorskip("sympy")
    if compiled:
        pytest.importorskip("numba")
    a, b, force, w, d = sympy.symbols("a b force w d")
    f, h = [a + d * b, b - d * w**2 * sympy.sin(a) + d * force], [sympy.sin(a) + sympy.Max(b, 0), a * b]
    model = filters.symbolic([a, b], f, h, inputs=[force], values={w: 2.0, "d": 0.01}, compiled=compiled)
    random = np.random.default_rng(2)
    z, u = random.normal(0, 0.1, (60, 2)), random.normal(0, 1, (60, 1))
    python = {
        "f": lambda x, u: [x[0] + 0.01 * x[1], x[1] - 0.04 * np.sin(x[0]) + 0.01 * u[0]],
        "h": lambda x, u: [np.sin(x[0]) + max(x[1], 0), x[0] * x[1]],
    }
    noise, start = {"Q": [1e-6, 1e-4], "R": [0.01, 0.04]}, ([0.3, 0.1], [0.1, 0.1])
    found = filters.Ekf(**model, **noise).run(z, *start, u)
    assert np.allclose(found.x, filters.Ekf(**python, **noise).run(z, *start, u).x, atol=1e-7)


@pytest.mark.parametrize("compiled", [False, True])
def test_rates_are_followed_to_the_fourth_order(compiled: bool) -> None:
    sympy = pytest.importorskip("sympy")
    if compiled:
        pytest.importorskip("numba")
    a, b = sympy.symbols("lambda class")
    noise = {"Q": [0, 0], "R": 1e6}
    ends = []
    for interval in (0.4, 0.2, 0.1):
        model = filters.symbolic([a, b], [b, -4 * sympy.sin(a)], [a], interval=interval, compiled=compiled)
        count = round(2 / interval)
        found = filters.Ekf(**model, **noise).run(np.full(count + 1, np.nan), [0.5, 0], [1e-4, 1e-4])
        ends.append(np.concatenate([found.x[-1], found.P[-1].ravel()]))
    coarse, fine = np.abs(ends[0] - ends[1]), np.abs(ends[1] - ends[2])
    # Sixteen times as close with half the step.
    assert np.linalg.norm(coarse) / np.linalg.norm(fine) == pytest.approx(16, rel=0.4)
    # The exact pendulum: 2 s at ω = 2/s and an amplitude of 0.5 rad, of the period 4·K(sin 0.25)/ω.
    from scipy.special import ellipj, ellipk

    k = np.sin(0.25)
    sn, *_ = ellipj(ellipk(k**2) - 2 * 2, k**2)
    assert ends[2][0] == pytest.approx(2 * np.arcsin(k * sn), abs=2e-5)


def test_expressions_that_cannot_be_meant_are_refused() -> None:
    sympy = pytest.importorskip("sympy")
    a, w = sympy.symbols("a w")
    with pytest.raises(ValueError, match="w of the expressions have no value; give it in `values`"):
        filters.symbolic([a], [w * a], [a])
    with pytest.raises(ValueError, match="`f` has 2 expressions; expected one for each of the 1 states"):
        filters.symbolic([a], [a, a], [a])
