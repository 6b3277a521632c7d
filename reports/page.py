"""The report as one HTML page: templates, style and scripts inline, under a strict policy.

The policy allows this page's own scripts and style sheets by their hashes and nothing else: no
request can leave the page, whatever text the results hold.
"""

import base64
import hashlib
import json
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from pydantic import BaseModel

from .content import Frame, PictureBlock
from .curves import Column, Histogram, Plot
from .document import Document
from .figures import draw_histogram, draw_plot
from .numbers import figure_quantity, format_quantity
from .verdicts import grouped, limits_text

SCRIPTS = (
    "decode.js",
    "theme.js",
    "columns.js",
    "plot.js",
    "cursor.js",
    "export.js",
    "photo.js",
    "frames.js",
    "main.js",
)
"""Our own scripts, in the order in which they are put into one function."""

UPLOT = ("uPlot.iife.min.js", "uPlot.min.css", "LICENSE")


def render(document: Document) -> str:
    """The page; the same document gives the same text."""
    script = _script() if document.interactive else ""
    plain = _style()
    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            document=document,
            policy=_policy(script, plain),
            style=Markup(plain),
            script=Markup(script),
            notice=_asset("uplot", "LICENSE") if document.interactive else "",
            twin=embedded(document.twin()),
            data=embedded(_data(document)) if document.interactive else "",
        )
    )


def embedded(value: Any) -> Markup:
    """JSON that cannot end the script element it stands in."""
    text = json.dumps(value, ensure_ascii=True, separators=(",", ":"), allow_nan=False)
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)


def has_uplot() -> bool:
    """Whether the plotting script came with this installation."""
    return all(files(__package__).joinpath("assets", "uplot", name).is_file() for name in UPLOT)


def _data(document: Document) -> dict[str, Any]:
    columns = {column.key: column for column in columns_of([document])}
    return {key: column.coded.model_dump(exclude_none=True) for key, column in columns.items()}


def columns_of(found: Iterable[Any]) -> Iterator[Column]:
    """The columns whose points the page needs, in its order; one may come several times."""
    for value in found:
        if isinstance(value, Column):
            yield value
        elif isinstance(value, Plot) and not value.live:
            continue
        elif isinstance(value, BaseModel):
            yield from columns_of(getattr(value, name) for name in type(value).model_fields)
        elif isinstance(value, list):
            yield from columns_of(value)


def _policy(script: str, style: str) -> str:
    sources = [
        "default-src 'none'",
        "img-src data:",
        f"style-src '{_hash(style)}'",
        f"script-src '{_hash(script)}'" if script else "script-src 'none'",
        "base-uri 'none'",
        "form-action 'none'",
    ]
    return "; ".join(sources)


def _hash(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _script() -> str:
    own = "\n".join(_asset(name) for name in SCRIPTS)
    return f'{_asset("uplot", UPLOT[0])}\n(() => {{\n"use strict";\n{own}\n}})();\n'


def _style() -> str:
    uplot = _asset("uplot", UPLOT[1]) if has_uplot() else ""
    return f"{uplot}\n{_asset('report.css')}"


@cache
def _asset(*path: str) -> str:
    return files(__package__).joinpath("assets", *path).read_text("utf-8")


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader(__package__ or "seamlog.reports", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "quantity": figure_quantity,
        "limits": limits_text,
        "drawing": _drawing,
        "data_uri": _data_uri,
    }
    environment.globals["quantity"] = format_quantity
    environment.globals["grouped"] = grouped
    return environment


def _drawing(block: Plot | Histogram) -> Any:
    return draw_histogram(block) if isinstance(block, Histogram) else draw_plot(block)


def _data_uri(picture: PictureBlock | Frame) -> str:
    return f"data:{picture.media_type};base64,{base64.b64encode(picture.image).decode()}"
