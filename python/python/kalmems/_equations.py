"""Models of filters as equations: in the language of `[device.equations]` with units, or as expressions of SymPy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _kalmems
from ._model_checks import numbers
from ._needed import needed

Numbers: TypeAlias = NDArray[np.float64]
_NONE = np.zeros(0)


class Equations:
    """A model in the language of equations with units, that `Ekf`, `Ukf` and the other filters of functions take.

    Every unit is checked and every derivative is made symbolically. States, inputs and measurements are arrays in SI in the order of the text.

    Parameters
    ----------
    text : str
        The tables of `[device.equations]` of an experiment without that heading: `[states]`, `[derivative]`, `[measure]` and others. States behind
        those of the text are those of its lags and delays.
    interval : float
        Seconds from a sample to the next.
    values : mapping, optional
        Other values of parameters, in SI.
    steps : int
        Steps from a sample to the next, over each of which the linear part is followed exactly.

    Examples
    --------
    >>> text = '''
    ... [states]
    ... angle = "rad"
    ... rate = "rad/s"
    ... [parameters]
    ... w = "2 1/s"
    ... [derivative]
    ... angle = "rate"
    ... rate = "-w^2*sin(angle)"
    ... [measure]
    ... height = "0.3[m]*(1 - cos(angle)) in cm"
    ... [noise]
    ... rate = "1e-6[1/s^3]"
    ... height = "0.01[cm^2]"
    ... '''
    >>> pendulum = Equations(text, interval=0.01)
    >>> pendulum
    Equations(angle in rad, rate in rad/s -> height in cm, every 0.01 s)
    >>> parts = pendulum.parts(x0=[0.5, 0])
    >>> parts["F"](np.array([0.5, 0.0])).round(5).tolist(), parts["R"].tolist()
    ([[0.99982, 0.01], [-0.0351, 0.99982]], [[1e-06]])
    """

    def __init__(self, text: str, interval: float, *, values: Mapping[str, float] | None = None, steps: int = 1) -> None:
        if not isinstance(text, str):
            raise TypeError(f"`text` is of the type {type(text).__name__}; expected tables of equations as text, or use `symbolic` for SymPy")
        if not (math.isfinite(interval) and interval > 0) or steps < 1:
            raise ValueError(f"`interval` is {interval} and `steps` {steps}; expected seconds above 0, and 1 step or more")
        self._text, self._interval, self._steps = text, float(interval), int(steps)
        changed = [(name, float(value)) for name, value in (values or {}).items()]
        self._changed = changed
        self._native = _kalmems.Equations(text, changed, self._interval, self._steps)
        self._states, self._inputs, self._measures, self._parameters = self._native.names()

    @property
    def states(self) -> dict[str, str]:
        """The states with the units in which the text has them, in their order in arrays, which are in SI."""
        return dict(self._states)

    @property
    def inputs(self) -> dict[str, str]:
        """The inputs likewise."""
        return dict(self._inputs)

    @property
    def measurements(self) -> dict[str, str]:
        """The measurements likewise."""
        return dict(self._measures)

    @property
    def values(self) -> dict[str, float]:
        """The values of the parameters in SI."""
        return dict(zip((name for name, _ in self._parameters), self._native.values().tolist(), strict=True))

    def f(self, x: ArrayLike, u: ArrayLike = _NONE) -> Numbers:
        """The state at the next sample, of the shape (n,), with inputs that are held until then."""
        return self._native.step(_flat("x", x), _flat("u", u))[0]

    def F(self, x: ArrayLike, u: ArrayLike = _NONE) -> Numbers:
        """∂f/∂x, of the shape (n, n)."""
        return self._native.step(_flat("x", x), _flat("u", u))[1].reshape(len(self._states), -1)

    def h(self, x: ArrayLike, u: ArrayLike = _NONE) -> Numbers:
        """The measurements, of the shape (m,)."""
        return self._native.measure(_flat("x", x), _flat("u", u))[0]

    def H(self, x: ArrayLike, u: ArrayLike = _NONE) -> Numbers:
        """∂h/∂x, of the shape (m, n)."""
        return self._native.measure(_flat("x", x), _flat("u", u))[1].reshape(len(self._measures), -1)

    def noise(self, x0: ArrayLike) -> tuple[Numbers, Numbers]:
        """Q and R of the noises that the text states, at a state and without inputs.

        Q is the integral of Φ·D·Φᵀ over the interval, with the densities D, by Simpson's rule: its error is of the fifth order in the interval.
        """
        at = _flat("x0", x0)
        density, variances = self._native.noise(at, self._interval)
        middle = _kalmems.Equations(self._text, self._changed, 0.5 * self._interval, self._steps)
        no_inputs = np.zeros(len(self._inputs))
        n, d = len(self._states), np.diag(density)
        half, whole = (one.step(at, no_inputs)[1].reshape(n, n) for one in (middle, self._native))
        q = self._interval / 6 * (d + 4 * half @ d @ half.T + whole @ d @ whole.T)
        return 0.5 * (q + q.T), np.diag(variances)

    def parts(self, x0: ArrayLike) -> dict[str, Any]:
        """What `Ekf` takes, with the noises at this state: `Ekf(**model.parts(x0))`."""
        q, r = self.noise(x0)
        return {"f": self.f, "h": self.h, "F": self.F, "H": self.H, "Q": q, "R": r}

    def __repr__(self) -> str:
        named = [", ".join(f"{name} in {unit}" for name, unit in names) for names in (self._states, self._inputs, self._measures)]
        states = "; ".join(part for part in named[:2] if part)
        return f"Equations({states} -> {named[2]}, every {self._interval:g} s)"


def _flat(name: str, values: ArrayLike) -> Numbers:
    return np.ascontiguousarray(np.atleast_1d(numbers(f"`{name}`", values)))


def symbolic(
    states: Sequence[Any],
    f: Sequence[Any],
    h: Sequence[Any],
    *,
    inputs: Sequence[Any] = (),
    values: Mapping[Any, float] | None = None,
    interval: float | None = None,
    compiled: bool = False,
) -> dict[str, Any]:
    """A model of expressions of SymPy, with derivatives, that `Ekf(**model, Q=…, R=…)` takes; needs SymPy (`kalmems[symbolic]`).

    Parameters
    ----------
    states, inputs : sequences of symbols
        In their order in arrays.
    f : sequence of expressions
        The next state; with an `interval` the rates ẋ instead, which one step of the method of Runge and Kutta of fourth order follows.
    h : sequence of expressions
        The measurements.
    values : mapping, optional
        Numbers for the other symbols.
    interval : float, optional
        Seconds from a sample to the next, if `f` has rates. An input is held over a step.
    compiled : bool
        Whether Numba compiles the functions.

    Returns
    -------
    dict
        `f`, `h`, `F` and `H`.

    Examples
    --------
    >>> import sympy
    >>> angle, rate, w = sympy.symbols("angle rate w")
    >>> model = symbolic([angle, rate], [rate, -w**2 * sympy.sin(angle)], [sympy.sin(angle)], values={w: 2}, interval=0.01)
    >>> model["f"]([0.5, 0.0]).round(6).tolist(), model["H"]([0.5, 0.0]).round(4).tolist()
    ([0.499904, -0.019176], [[0.8776, 0.0]])
    """
    sympy = needed("sympy", "symbolic")
    given = {sympy.Symbol(name) if isinstance(name, str) else name: sympy.Float(value) for name, value in (values or {}).items()}
    state, driven = list(states), list(inputs)
    moves, sees = ([sympy.sympify(one).subs(given) for one in expressions] for expressions in (f, h))
    if len(moves) != len(state):
        raise ValueError(f"`f` has {len(moves)} expressions; expected one for each of the {len(state)} states")
    unknown = sorted(str(one) for one in set().union(*(one.free_symbols for one in [*moves, *sees])) - set(state) - set(driven))
    if unknown:
        raise ValueError(f"{', '.join(unknown)} of the expressions have no value; give it in `values`, or name it among `states` or `inputs`")
    names = [*state, *driven]
    variables = {symbol: sympy.Symbol(f"x[{k}]" if k < len(state) else f"u[{k - len(state)}]") for k, symbol in enumerate(names)}

    def written(expressions: Sequence[Any]) -> str:
        return _source(sympy, [one.subs(variables, simultaneous=True) for one in expressions])

    slopes = {"F": [one.diff(by) for one in moves for by in state], "H": [one.diff(by) for one in sees for by in state]}
    sources = {"f": written(moves), "h": written(sees), "F": written(slopes["F"]), "H": written(slopes["H"])}
    counts = {"f": len(state), "h": len(sees), "F": len(state) ** 2, "H": len(sees) * len(state)}
    if compiled:
        return _compiled(sources, counts, len(state), interval)
    shapes = {"f": (-1,), "h": (-1,), "F": (len(state), len(state)), "H": (len(sees), len(state))}
    plain = {name: _filled(source, counts[name]) for name, source in sources.items()}
    whole = plain if interval is None else {**plain, **_stepped(plain["f"], plain["F"], len(state), interval)}
    return {name: _shaped(whole[name], shapes[name]) for name in ("f", "h", "F", "H")}


def _source(sympy: Any, expressions: Sequence[Any]) -> str:
    """Statements that write the values of expressions to `out`, each common part once."""
    from sympy.printing.pycode import PythonCodePrinter

    printer = PythonCodePrinter({"fully_qualified_modules": True})
    common, reduced = sympy.cse(expressions, symbols=sympy.numbered_symbols("part_"))
    lines = [f"{name} = {printer.doprint(part)}" for name, part in common]
    lines += [f"out[{place}] = {printer.doprint(one)}" for place, one in enumerate(reduced)]
    return "\n    ".join(lines)


def _made(source: str, arguments: str) -> Any:
    names: dict[str, Any] = {"math": math}
    # Of expressions alone, whose symbols have other names by now.
    exec(f"def function({arguments}):\n    {source}\n", names)  # noqa: S102
    return names["function"]


def _filled(source: str, count: int) -> Any:
    function = _made(source, "x, u, out")

    def call(x: Numbers, u: Numbers) -> Numbers:
        out = np.empty(count)
        function(x, u, out)
        return out

    return call


def _stepped(rates: Any, slopes: Any, n: int, interval: float) -> dict[str, Any]:
    def step(x: Numbers, u: Numbers) -> tuple[Numbers, Numbers]:
        k, j = rates(x, u), slopes(x, u).reshape(n, n)
        moved, turned = x + interval / 6 * k, np.eye(n) + interval / 6 * j
        for part, weight in ((0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)):
            at, by = x + part * interval * k, np.eye(n) + part * interval * j
            k, j = rates(at, u), slopes(at, u).reshape(n, n) @ by
            moved, turned = moved + weight * interval * k, turned + weight * interval * j
        return moved, turned

    return {"f": lambda x, u: step(x, u)[0], "F": lambda x, u: step(x, u)[1]}


def _shaped(function: Any, shape: tuple[int, ...]) -> Any:
    def call(x: ArrayLike, u: ArrayLike = _NONE) -> Numbers:
        return np.asarray(function(_flat("x", x), _flat("u", u)).reshape(shape))

    return call


_STEP = """
    k, j, at, by = np.empty(n), np.empty(n * n), np.empty(n), np.eye(n)
    moved, turned = np.empty(n), np.eye(n)
    for i in range(n):
        at[i] = moved[i] = x[i]
    for part, weight in ((0.5, 1 / 6), (0.5, 1 / 3), (1.0, 1 / 3), (0.0, 1 / 6)):
        rates(at, u, k)
        slopes(at, u, j)
        led = j.reshape((n, n)) @ by
        for i in range(n):
            moved[i] += weight * interval * k[i]
            at[i] = x[i] + part * interval * k[i]
        turned += weight * interval * led
        by = np.eye(n) + part * interval * led
"""


def _compiled(sources: Mapping[str, str], counts: Mapping[str, int], n: int, interval: float | None) -> dict[str, Any]:
    numba = needed("numba", "numba")
    as_c = numba.cfunc("void(CPointer(float64), CPointer(float64), CPointer(float64))")
    functions = {name: _made(source, "x, u, out") for name, source in sources.items()}
    made = {name: as_c(functions[name]) for name in ("h", "H")}
    if interval is None:
        return {**made, "f": as_c(functions["f"]), "F": as_c(functions["F"])}
    held = {"np": np, "n": n, "interval": interval, "rates": numba.njit(functions["f"]), "slopes": numba.njit(functions["F"])}
    ends = {"f": "\n    for i in range(n):\n        out[i] = moved[i]", "F": "\n    for i in range(n * n):\n        out[i] = turned[i // n, i % n]"}
    for name, end in ends.items():
        names = dict(held)
        exec(f"def step(x, u, out):{_STEP}{end}\n", names)  # noqa: S102
        made[name] = as_c(names["step"])
    return made
