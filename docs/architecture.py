"""Draw the rooms of the repository and their imports: `make architecture` writes the picture and the table.

The rooms are the root packages of import-linter. A room is above all that it imports; an arrow that a longer
way implies is left out.
"""

import ast
import re
import sys
import textwrap
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.sax.saxutils import escape

import grimp

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
PICTURE = ROOT / "docs" / "pictures" / "architecture.svg"
TABLE = re.compile(r"(?<=<!-- drawn -->\n).*(?=<!-- end -->)", re.DOTALL)

_WIDTH, _BOX, _LINE, _GAP = 960, 220, 18, 56
_STYLE = (
    "rect{fill:#f6f8fa;stroke:#57606a}path{fill:none;stroke:#57606a;stroke-width:1.5}"
    "text{font:13px system-ui,sans-serif;fill:#1f2328;text-anchor:middle}"
    ".room{font-weight:600;font-size:16px}"
)

Graph = Mapping[str, frozenset[str]]


@dataclass(frozen=True, kw_only=True)
class Place:
    """Centre of a box, or of an arrow that passes a level, and the lines that are written there."""

    x: float
    top: float
    bottom: float
    lines: tuple[str, ...] = ()


def read_rooms() -> tuple[Graph, dict[str, list[str]]]:
    """Return which rooms each room imports, and the packages within each."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    names = project["tool"]["importlinter"]["root_packages"]
    graph = grimp.build_graph(*names, cache_dir=None)
    found: dict[str, set[str]] = {name: set() for name in names}
    for module in graph.modules:
        for target in graph.find_modules_directly_imported_by(module):
            found[module.partition(".")[0]].add(target.partition(".")[0])
    inside = {
        name: sorted(path.parent.name for path in (ROOT / name).glob("*/__init__.py"))
        for name in sorted(names)
    }
    return {name: frozenset(found[name] - {name}) for name in sorted(names)}, inside


def reduce(graph: Graph) -> Graph:
    """Return the graph without the imports that a longer way implies."""
    reached: dict[str, frozenset[str]] = {}

    def reach(room: str) -> frozenset[str]:
        if room not in reached:
            reached[room] = graph[room].union(*(reach(each) for each in graph[room]))
        return reached[room]

    return {
        room: frozenset(each for each in below if not any(each in reach(other) for other in below))
        for room, below in graph.items()
    }


def rank(graph: Graph) -> dict[str, int]:
    """Return the level of each room, 0 at the bottom; each is as high as its lowest user allows."""
    levels: dict[str, int] = {}

    def level(room: str) -> int:
        if room not in levels:
            levels[room] = 1 + max((level(each) for each in graph[room]), default=-1)
        return levels[room]

    for room in graph:
        level(room)
    for room in sorted(graph, key=lambda each: -levels[each]):
        users = [levels[each] for each in graph if room in graph[each]]
        levels[room] = min(users, default=levels[room] + 1) - 1
    return levels


def arrange(graph: Graph, levels: Mapping[str, int]) -> tuple[list[list[str]], list[tuple[str, str]]]:
    """Return the rows from the top, and the arrows in steps of one level.

    An arrow over several levels passes a place of its own, ``user>room@level``, in each row between. Rows are
    ordered by the mean position of what they lead to, which keeps crossings few.
    """
    rows: list[list[str]] = [[] for _ in range(max(levels.values()) + 1)]
    steps: list[tuple[str, str]] = []
    for room in sorted(graph):
        rows[levels[room]].append(room)
        for each in sorted(graph[room]):
            between = [f"{room}>{each}@{level}" for level in range(levels[room] - 1, levels[each], -1)]
            for place in between:
                rows[int(place.partition("@")[2])].append(place)
            chain = [room, *between, each]
            steps += pairwise(chain)
    for _ in range(4):
        for row, beside, up in (
            *((rows[i], rows[i - 1], True) for i in range(1, len(rows))),
            *((rows[i], rows[i + 1], False) for i in reversed(range(len(rows) - 1))),
        ):
            _order(row, beside, [(a, b) if up else (b, a) for a, b in steps])
    return rows[::-1], steps


def _order(row: list[str], beside: list[str], steps: Iterable[tuple[str, str]]) -> None:
    share = {place: (index + 0.5) / len(beside) for index, place in enumerate(beside)}
    pulls: dict[str, list[float]] = {place: [] for place in row}
    for place, other in steps:
        if place in pulls and other in share:
            pulls[place].append(share[other])
    own = {place: (index + 0.5) / len(row) for index, place in enumerate(row)}
    row.sort(key=lambda each: sum(pulls[each]) / len(pulls[each]) if pulls[each] else own[each])


def draw(graph: Graph, inside: Mapping[str, list[str]]) -> str:
    """Return the picture as SVG."""
    direct = reduce(graph)
    rows, steps = arrange(direct, rank(direct))
    words = {room: tuple(textwrap.wrap(", ".join(inside[room]), 27)) for room in graph}
    places: dict[str, Place] = {}
    top = 20.0
    for row in rows:
        tall = 34 + _LINE * max(len(words.get(each, ())) for each in row)
        for index, each in enumerate(row):
            x = _WIDTH * (index + 0.5) / len(row)
            places[each] = Place(x=x, top=top, bottom=top + tall, lines=words.get(each, ()))
        top += tall + _GAP
    parts = [_arrow(places[upper], places[lower], ends=lower in graph) for upper, lower in steps]
    parts += [
        f'<path d="M{place.x:.0f} {place.top:.0f}V{place.bottom:.0f}"/>'
        for name, place in sorted(places.items())
        if name not in graph
    ]
    parts += [_box(name, places[name]) for name in sorted(graph)]
    height = top - _GAP + 20
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height:.0f}" role="img">'
        "<title>The rooms of stilb; an arrow points to what a room imports</title>"
        f"<style>{_STYLE}</style><defs><marker id='a' viewBox='0 0 8 8' refX='8' refY='4' markerWidth='8' "
        "markerHeight='8' orient='auto'><path d='M0 0L8 4L0 8'/></marker></defs>"
        '<rect width="100%" height="100%" style="fill:#fff;stroke:none"/>'
    )
    return "\n".join([head, *parts, "</svg>", ""])


def _arrow(upper: Place, lower: Place, *, ends: bool) -> str:
    middle = (upper.bottom + lower.top) / 2
    curve = f"M{upper.x:.0f} {upper.bottom:.0f}C{upper.x:.0f} {middle:.0f} {lower.x:.0f} {middle:.0f}"
    mark = ' marker-end="url(#a)"' if ends else ""
    return f'<path d="{curve} {lower.x:.0f} {lower.top:.0f}"{mark}/>'


def _box(name: str, place: Place) -> str:
    left, tall = place.x - _BOX / 2, place.bottom - place.top
    return "\n".join(
        [
            f'<rect x="{left:.0f}" y="{place.top:.0f}" width="{_BOX}" height="{tall:.0f}" rx="6"/>',
            f'<text class="room" x="{place.x:.0f}" y="{place.top + 22:.0f}">{escape(name)}/</text>',
            *(
                f'<text x="{place.x:.0f}" y="{place.top + 44 + _LINE * index:.0f}">{escape(line)}</text>'
                for index, line in enumerate(place.lines)
            ),
        ]
    )


def tabulate(graph: Graph) -> str:
    """Return the table of rooms: the first line of each docstring, and which rooms each imports."""
    levels = rank(reduce(graph))
    rows = ["| room | what it is | imports |", "|---|---|---|"]
    for room in sorted(graph, key=lambda each: (levels[each], each)):
        text = ast.get_docstring(ast.parse((ROOT / room / "__init__.py").read_text(encoding="utf-8"))) or ""
        imports = ", ".join(sorted(graph[room])) or "nothing of ours"
        rows.append(f"| `{room}/` | {text.splitlines()[0]} | {imports} |")
    return "\n".join([*rows, ""])


def render() -> dict[Path, str]:
    """Return the files that the imports decide, as they should be."""
    graph, inside = read_rooms()
    page = TABLE.sub(lambda _: tabulate(graph), PAGE.read_text(encoding="utf-8"))
    return {PICTURE: draw(graph, inside), PAGE: page}


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    for path, text in render().items():
        path.write_text(text, encoding="utf-8")
        sys.stdout.write(f"{path.relative_to(ROOT)}\n")
