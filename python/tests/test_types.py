"""The types of the package say what it gives: those of metrics are compared with metrics, and what a user's type checker sees is asked of it."""

from __future__ import annotations

import re
import types
import typing
from pathlib import Path
from typing import Any

import pytest
from conftest import EXAMPLES

import kalmems
from kalmems import metrics

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.filterwarnings("ignore::kalmems.VerdictWarning")


class NotNeeded:
    """Stands for `NotRequired`, which Python 3.10 does not have."""

    def __class_getitem__(cls, of: Any) -> Any:
        return typing.Annotated[of, NotNeeded]


NAMES = {**vars(metrics), "NotRequired": NotNeeded}


def faults(value: Any, kind: Any, place: str) -> list[str]:
    """How a value differs from a type."""
    if isinstance(kind, (str, typing.ForwardRef)):
        kind = eval(kind if isinstance(kind, str) else kind.__forward_arg__, NAMES)
    if typing.get_origin(kind) is typing.Annotated:
        kind = typing.get_args(kind)[0]
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if isinstance(kind, types.UnionType):
        return [] if value is None else faults(value, arguments[0], place)
    if typing.is_typeddict(kind):
        return faults_of_table(value, kind, place)
    if origin is list:
        return [fault for one in value for fault in faults(one, arguments[0], f"{place}[]")]
    if origin is dict:
        return [fault for name, one in value.items() for fault in faults(one, arguments[1], f"{place}.{name}")]
    if origin is tuple:
        return [fault for one, of in zip(value, arguments, strict=True) for fault in faults(one, of, f"{place}[]")]
    is_kind = isinstance(value, (int, float) if kind is float else kind)
    return [] if is_kind else [f"{place}: {value!r} is no {kind.__name__}"]


def faults_of_table(value: dict[str, Any], kind: Any, place: str) -> list[str]:
    found = [f"{place}: unknown key {name}" for name in value.keys() - kind.__annotations__.keys()]
    for name, of in kind.__annotations__.items():
        text = of.__forward_arg__ if isinstance(of, typing.ForwardRef) else str(of)
        if name in value:
            found += faults(value[name], of, f"{place}.{name}")
        elif "NotRequired[" not in text:
            found.append(f"{place}: {name} is missing")
    return found


@pytest.mark.parametrize(
    "experiment",
    [
        "shared_scanner/experiment.toml",
        "shared_scanner/stiffness_state.toml",
        "threshold_scanner/experiment.toml",
        "micro_stage/experiment.toml",
        "accelerometer/experiment.toml",
        "piston_mirror/experiment.toml",
        "comb_resonator/experiment.toml",
    ],
)
def test_metrics_are_of_their_types(experiment: str) -> None:
    result = kalmems.Experiment.load(EXAMPLES / experiment).estimate()
    assert faults(result.metrics, metrics.Metrics, "metrics") == []


def test_a_metric_of_another_type_is_found() -> None:
    good: dict[str, Any] = {"mean_nis": 1.0, "lower": 0, "upper": 2.0, "updates": 3, "log_likelihood": -1.0}
    assert faults(good, metrics.Consistency, "") == []
    assert faults({**good, "updates": "3"}, metrics.Consistency, "c") == ["c.updates: '3' is no int"]
    assert faults({**good, "new": 1}, metrics.Consistency, "c") == ["c: unknown key new"]
    del good["lower"]
    assert faults(good, metrics.Consistency, "c") == ["c: lower is missing"]


# Structures of Rust with the types that are theirs here if the names differ.
RENAMED = {"NisConsistency": "Consistency", "QuantityAnswer": "Answer"}
# With the keys of another structure or of an enumeration among their own.
FLATTENED = {"Answer", "FindingText"}


def test_metrics_have_the_keys_of_the_structures_that_are_written() -> None:
    """Those that no example has are there as well."""
    texts = [file.read_text(encoding="utf-8") for file in sorted((ROOT / "crates").glob("kalmems*/src/**/*.rs"))]
    structures = {name: body for text in texts for name, body in re.findall(r"Serialize\)\]\n(?:#\[.*\n)*pub struct (\w+) \{\n(.*?)\n\}", text, re.DOTALL)}
    names = {rust: RENAMED.get(rust, rust) for rust in structures}

    def keys(rust: str) -> dict[str, bool]:
        """The keys of a structure, with those of structures within it that have no key, and whether each may be left out."""
        found: dict[str, bool] = {}
        fields = re.findall(r"((?:    #\[.*\]\n)*)    (?:pub )?(\w+): ([^,\n]+)", re.sub(r"    ///.*\n", "", structures[rust] + "\n"))
        for attributes, field, kind in fields:
            if "flatten" in attributes and kind in structures:
                found |= keys(kind)
            elif "serde(skip)" not in attributes:
                renamed = re.search(r'rename = "(\w+)"', attributes)
                found[renamed[1] if renamed else field] = "skip_serializing_if" in attributes
        return found

    compared = 0
    for rust, name in names.items():
        if name not in metrics.__all__ or name in FLATTENED:
            continue
        written = keys(rust)
        annotations = getattr(metrics, name).__annotations__
        own = {key: "NotRequired[" in (of.__forward_arg__ if isinstance(of, typing.ForwardRef) else str(of)) for key, of in annotations.items()}
        assert own == written, name
        compared += 1
    assert compared > 25


CODE = """
import kalmems

result = kalmems.Experiment.load("experiment.toml").estimate({"time_s": [0.0]})
ekf = result["EKF"]
reveal_type(ekf.angle)
reveal_type(ekf.angle_sd)
reveal_type(ekf.metrics["grade"])
errors = ekf.metrics["errors"]
assert errors is not None
reveal_type(errors["angle"]["rmse_deg"])
reveal_type(result.metrics["recordings"][0]["segments"][0]["motion_hz"])
ekf.metrics["grad"]
reveal_type(ekf.to_polars())
reveal_type(ekf.to_xarray())
reveal_type(result.plot())
reveal_type(kalmems.Study.run)
"""
SEEN = [
    r"ndarray\[.*float64\]\]",
    r"ndarray\[.*float64\]\]",
    r"str \| None",
    r"float",
    r"float \| None",
    r"polars\.[\w.]*DataFrame",
    r"xarray\.[\w.]*Dataset",
    r"matplotlib\.axes\.[\w.]*Axes",
    r".*StudyResult",
]


def test_a_type_checker_knows_numbers_metrics_tables_and_pictures(tmp_path: Path) -> None:
    api = pytest.importorskip("mypy.api")
    for library in ("polars", "xarray", "matplotlib"):
        pytest.importorskip(library)
    file = tmp_path / "use.py"
    file.write_text(CODE)
    # Nothing of the package's own settings, as a user's project has none of them. The cache is kept: reading all libraries takes half a minute.
    told, failed, _ = api.run(["--strict", "--config-file=", "--cache-dir", str(ROOT / "python/target/types"), str(file)])
    assert not failed
    revealed = re.findall(r'Revealed type is "(.*)"', told)
    assert len(revealed) == len(SEEN), told
    for found, expected in zip(revealed, SEEN, strict=True):
        assert re.search(f"{expected}$|{expected} *\\)?$", found), (found, expected)
    others = [line for line in told.splitlines() if ": error:" in line]
    assert len(others) == 1 and 'has no key "grad"' in others[0], told
