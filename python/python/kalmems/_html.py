"""Pieces of HTML, as notebooks show them."""

from __future__ import annotations

import html
import re
import sys
from collections.abc import Iterable, Sequence
from typing import Any

from ._errors import KalmemsError


def heading(text: str) -> str:
    return f"<h4>{html.escape(text)}</h4>"


def paragraph(text: str) -> str:
    """A paragraph; what stands between backticks is code."""
    return f"<p>{coded(text)}</p>"


def coded(text: str) -> str:
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text))


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(text)}</th>" for text in heads)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


class Page:
    """A whole page of HTML in a frame of its own, so that its styles and scripts do not meet those of the notebook."""

    def __init__(self, text: str, height: int) -> None:
        self._text, self._height = text, height

    def _repr_html_(self) -> str:
        style = f"width:100%;height:{self._height}px;border:0"
        return f'<iframe srcdoc="{html.escape(self._text)}" style="{style}"></iframe>'


def show(page: Page) -> None:
    """Displays a page in the notebook that is running."""
    # Whatever runs a notebook has imported it.
    ipython: Any = sys.modules.get("IPython")
    if ipython is None or ipython.get_ipython() is None:
        raise KalmemsError("there is no notebook to show the report in; `write(folder)` writes it as a file, and `report_html()` gives its text")
    ipython.display.display(page)
