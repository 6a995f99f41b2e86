"""Units of pint, as experiments and recordings write them."""

from __future__ import annotations

from typing import Any


def is_quantity(value: Any) -> bool:
    """Whether a value is a quantity of pint: numbers with a unit."""
    return hasattr(value, "magnitude") and hasattr(value, "units")


def spelled(unit: Any) -> str:
    """A unit of pint as experiments write it, such as `m^2/s^3`; of a number without a unit nothing."""
    return f"{unit:~C}".replace("**", "^").replace("*", " ")


def text(quantity: Any) -> str:
    """A quantity as a value of an experiment, such as `4.0 ms`."""
    return f"{float(quantity.magnitude)!r} {spelled(quantity.units)}".rstrip()
