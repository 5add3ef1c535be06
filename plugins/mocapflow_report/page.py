"""The look of the report: plain HTML in one file."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from html import escape
from string import Template
from typing import Any

PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>$title</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 1200px; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.6rem; margin-bottom: 0 } h2 { font-size: 1.15rem; margin-top: 2.2rem }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: 14px } figure { margin: 1rem 0 }
td, th { padding: .25rem .8rem .25rem 0; text-align: right; border-bottom: 1px solid #e5e5e5 }
td:first-child, th:first-child { text-align: left; white-space: nowrap } th { vertical-align: bottom; font-weight: 600 }
img { max-width: 100% } figcaption, .quiet { color: #666 } ul { padding-left: 1.2rem }
pre { background: #f6f6f6; padding: .8rem; overflow-x: auto; font-size: 12px; line-height: 1.35; white-space: pre-wrap }
@page { size: A4; margin: 14mm }
@media print {
  body { font-size: 10pt; margin: 0; padding: 0 } table { font-size: 8.5pt } pre { font-size: 7pt }
  figure, tr { break-inside: avoid } h2 { break-after: avoid } pre { columns: 2 }
}
</style></head><body>
<h1>$title</h1><p class="quiet">$subtitle</p>
$sections
</body></html>
""")


def page(title: str, subtitle: str, sections: Sequence[tuple[str, str]]) -> str:
    """Return the whole page; sections are a heading and HTML, empty ones are left out."""
    parts = [f"<h2>{escape(heading)}</h2>\n{content}" for heading, content in sections if content]
    return PAGE.substitute(title=escape(title), subtitle=escape(subtitle), sections="\n".join(parts))


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a table; the keys of the first row are the header."""
    if not rows:
        return ""
    head = "".join(f"<th>{escape(str(key).replace('_', ' '))}</th>" for key in rows[0])  # may break into lines
    lines = ["".join(f"<td>{escape(_cell(value))}</td>" for value in row.values()) for row in rows]
    return f"<table><tr>{head}</tr>\n" + "\n".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def picture(content: bytes, kind: str, caption: str = "") -> str:
    """Return an image held in the page itself; kind is png or jpeg."""
    data = base64.b64encode(content).decode()
    image = f'<img src="data:image/{kind};base64,{data}" alt="{escape(caption)}">'
    return f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>"


def listing(lines: Sequence[str]) -> str:
    """Return a list, empty for no lines."""
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>" if lines else ""


def code(text: str) -> str:
    """Return preformatted text."""
    return f"<pre>{escape(text)}</pre>" if text else ""


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.2f}" if math.isfinite(value) else "–"
    return str(value)
