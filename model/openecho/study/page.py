"""Reports as pages: one HTML file that needs nothing else, no network and no server."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from plotly.graph_objects import Figure

    Part: TypeAlias = str | Figure | tuple[str, Figure]

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: blob:"
"""What the browser lets the page do: nothing from anywhere else, so that a page that needs it is noticed."""

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.7rem; } h2 { font-size: 1.25rem; margin-top: 2.5rem; }
table { border-collapse: collapse; font-size: 0.88rem; display: block; overflow-x: auto;
  margin: 0.5rem 0 1rem; }
th, td { border-bottom: 1px solid #ddd; padding: 0.3rem 0.5rem; text-align: right; vertical-align: top;
  white-space: nowrap; }
th:first-child, td:first-child, .prose td, .prose th { text-align: left; }
th, .prose td { white-space: normal; }
th:first-child, td:first-child { position: sticky; left: 0; background: #fff; } summary { cursor: pointer; }
.beside { display: flex; flex-wrap: wrap; gap: 1rem; } .beside > div { flex: 1 1 20rem; min-width: 0; }
th, th:first-child { background: #f5f5f5; } .failed td { background: #fbe3e0; }
.note { color: #666; font-size: 0.88rem; }
"""


CONFIG = {
    "displaylogo": False,
    "showSendToCloud": False,
    "modeBarButtons": [["toImage", "zoom2d", "pan2d", "resetScale2d"]],
}
"""Of figures: without the button that uploads them, and few others, as on a phone they lie on what is at the top."""


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes
    ----------
    title : str
    text : str
        What is to be seen; plain.
    parts : sequence
        HTML of `table`, `ranked` and `folded`, and plotly's figures, in the order in which they are shown; with the id
        of its element before it, a figure can be found again: ``("speed", figure)``. A list of them stands side by
        side where there is room.
    """

    title: str
    text: str
    parts: Sequence[Part | list[Part]] = ()


def table(
    head: Iterable[object], rows: Iterable[Iterable[object]], *, prose: bool = False, failed: Sequence[bool] = ()
) -> str:
    """Table as HTML.

    Parameters
    ----------
    head, rows : iterables
        Cells; whatever they are, they are shown as text.
    prose : bool
        Whether cells are words, and so begin at the left.
    failed : sequence of bool, optional
        Rows that are to be red.
    """
    body = []
    for number, row in enumerate(rows):
        red = ' class="failed"' if number < len(failed) and failed[number] else ""
        body.append(f"<tr{red}>{_cells('td', row)}</tr>")
    kind = ' class="prose"' if prose else ""
    return f"<table{kind}><thead><tr>{_cells('th', head)}</tr></thead><tbody>{''.join(body)}</tbody></table>"


def ranked(lines: Iterable[object]) -> str:
    """Numbered list as HTML; whatever its lines are, they are shown as text."""
    return f"<ol>{''.join(f'<li>{escape(str(line))}</li>' for line in lines)}</ol>"


def folded(title: str, html: str, *, unfolded: bool = False) -> str:
    """HTML that is shown, or no longer, when its title is clicked."""
    return f"<details{' open' if unfolded else ''}><summary>{escape(title)}</summary>{html}</details>"


def write(path: Path, title: str, lead: str, sections: Sequence[Section], note: str = "") -> None:
    """Write a page, complete or not at all.

    Parameters
    ----------
    path : Path
    title, lead, note : str
        Heading, what the page says in a sentence or two, and what it was made with.
    sections : sequence of Section

    Raises
    ------
    ModuleNotFoundError
        If there are figures and plotly is not installed.
    OSError
        If the file can't be written.
    """
    drawn = any(not isinstance(part, str) for section in sections for part in section.parts)
    lines = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{escape(POLICY)}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<link rel="icon" href="data:,">',
        f"<title>{escape(title)}</title><style>{STYLE}</style>",
        f"<script>{_plotly()}</script>" if drawn else "",
        f"</head><body><h1>{escape(title)}</h1><p>{escape(lead)}</p>",
        *(line for section in sections for line in _section(section)),
        f'<p class="note">{escape(note)}</p></body></html>',
    ]
    partial = path.with_name(f"{path.name}.partial")
    partial.write_text("\n".join(lines) + "\n", encoding="utf-8")
    partial.replace(path)


def _section(section: Section) -> Iterable[str]:
    yield f"<h2>{escape(section.title)}</h2><p>{escape(section.text)}</p>"
    for part in section.parts:
        if isinstance(part, list):
            yield f'<div class="beside">{"".join(f"<div>{_html(each)}</div>" for each in part)}</div>'
        else:
            yield _html(part)


def _html(part: Part) -> str:
    if isinstance(part, str):
        return part
    name, figure = part if isinstance(part, tuple) else (None, part)
    html: str = figure.to_html(full_html=False, include_plotlyjs=False, config=CONFIG, div_id=name)
    return html


def _plotly() -> str:
    from plotly.offline import get_plotlyjs  # optional

    script: str = get_plotlyjs()
    return script


def _cells(tag: str, cells: Iterable[object]) -> str:
    return "".join(f"<{tag}>{escape(str(cell))}</{tag}>" for cell in cells)
