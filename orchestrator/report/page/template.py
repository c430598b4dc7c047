"""A page put together: the template's placeholders filled in one pass, or a plain page where no template was built."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orchestrator.report.page.html import Html, escape, tag

DIST = Path(__file__).parents[1] / "web" / "dist"
"""What ``make page`` builds."""
NEEDED = ("page.html", "page.css", "page.js")
PLACEHOLDER = re.compile(r"@@([A-Z]+)@@")
HOW = "The interactive page was not built; `make page` builds it, then `orchestrator report` makes this one anew."
PLAIN_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:64em;margin:2em auto;padding:0 1em;color:#1b2430}
h1{font-size:1.4em;margin:.2em 0}h2{font-size:1.1em;margin:1.6em 0 .2em}.subtitle,.covers,.muted,small{color:#5d6875}
.verdict{display:inline-block;font-weight:700;padding:.2em .8em;border-radius:1em;background:#e3e7ec}
.safe{background:#dff3e8;color:#0b7a4b}.unsafe{background:#fbe4e2;color:#b3261e}.unclear{background:#fff1d6;color:#7a4b00}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(190px,1fr));gap:10px;margin:1em 0}
.tile{border:1px solid #ddd;border-radius:8px;padding:.5em .8em}.tile b{display:block;font-size:1.3em}
.bar{height:6px;background:#e3e7ec;border-radius:3px;margin-top:.4em}.bar i{display:block;height:100%;background:#0072b2}
.over .bar i{background:#b3261e}table{border-collapse:collapse;margin:.5em 0}.scroll{overflow-x:auto}
th,td{text-align:left;vertical-align:top;padding:.2em 1.2em .2em 0;border-bottom:1px solid #ddd}
.assumed{color:#b04a00;font-weight:600}.notice{background:#fff1d6;padding:.5em .8em;border-radius:8px}
pre{white-space:pre-wrap;font-size:12px}img{max-width:100%;margin:1em 0}button[data-seek]{display:none}"""


@dataclass(frozen=True)
class Body:
    """What people read of a page without any script: `top` (verdict and tiles) stands above the picture, `tables` below."""

    top: Html
    tables: Html

    def around(self, places: Html) -> Html:
        """Return all of it, with the `places` that scripts fill between."""
        return Html(self.top + places + self.tables)


def is_built(web: Path = DIST) -> bool:
    """Whether there is a template to fill."""
    return all((web / name).is_file() for name in NEEDED)


def filled(web: Path, title: str, body: Body, head: Mapping[str, Any], blob: str, wasm: str = "") -> str:
    """Return the interactive page."""
    script = _read(web, "page.js")
    values = {
        "CSP": policy(script),
        "TITLE": escape(title),
        "STYLE": _read(web, "page.css"),
        "SCRIPT": script,
        "WORKER": _read(web, "worker.js"),
        "HEAD": as_json(head),
        "BLOB": blob,
        "WASM": wasm,
        "BODY": body.around(places(head["kind"])),
        "LICENCES": escape(_read(web, "licences.txt")),
    }
    return PLACEHOLDER.sub(lambda match: values[match[1]], _read(web, "page.html"))


def places(kind: str) -> Html:
    """Return the empty places that scripts fill: map, picture and plots, what-if."""
    work = tag(
        "div", (tag("section", class_="card", id="stage"), tag("section", class_="card", id="plots")), class_="work"
    )
    the_map = tag("section", class_="card", id="map") if kind == "sweep" else Html()
    return Html(the_map + work + tag("section", class_="card", id="whatif", hidden=""))


def policy(script: str) -> str:
    """Return the content security policy: this script, the worker and WebAssembly that it starts, and nothing from anywhere."""
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    return (
        f"default-src 'none'; script-src 'sha256-{digest}' 'wasm-unsafe-eval'; worker-src blob:; "
        "style-src 'unsafe-inline'; img-src data: blob:"
    )


def as_json(content: Any) -> str:
    """Return `content` as JSON that can stand in a script element: nothing in it ends or comments one."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("</", "<\\/").replace("<!--", "<\\u0021--")


def _read(web: Path, name: str) -> str:
    path = web / name
    return path.read_text(encoding="utf-8") if path.is_file() else ""


def plain(title: str, body: Body, pictures: Iterable[tuple[str, Path]]) -> str:
    """Return the page without scripts: tables, and `pictures` (by what they show) in it."""
    notice = tag("p", HOW, class_="notice")
    main = tag("main", (body.top, notice, *(_image(name, path) for name, path in pictures), body.tables))
    policy_ = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy_}">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(title)}</title><style>{PLAIN_STYLE}</style></head><body>{main}</body></html>\n"
    )


def _image(name: str, path: Path) -> Html:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    return Html(f'<img src="data:image/png;base64,{data}" alt="{escape(name)}">')
