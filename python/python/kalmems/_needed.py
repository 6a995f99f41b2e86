"""Libraries that need not be installed, each by the extra of this package that brings it."""

from __future__ import annotations

import importlib
from typing import Any


def needed(module: str, extra: str) -> Any:
    """A module that this package does not depend on."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        library = module.partition(".")[0]
        raise ImportError(f"this needs {library}, which is not installed: pip install 'kalmems[{extra}]'") from error
