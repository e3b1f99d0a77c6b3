"""Write what is derived from the specifications: `make tables`.

The tables of parameters and coefficients in the pages of the methods, and the methods that the client knows
without asking a service. A table stands
between `<!-- parameters -->` or `<!-- coefficients -->` and `<!-- end -->`.
"""

import json
import re
from collections.abc import Iterable
from pathlib import Path

from radiometry.methods import METHODS
from radiometry.specification import method, parameters
from service.calibrations.methods import describe_methods

DOCS = Path(__file__).resolve().parent
CLIENT = DOCS.parent / "stilb" / "field" / "methods.json"


def render() -> dict[Path, str]:
    """Return each file with its text as the specifications give it."""
    pages = {}
    for spec in METHODS:
        path = DOCS / f"{spec.name}.md"
        text = path.read_text(encoding="utf-8")
        for name, lines in (("parameters", list_parameters(spec)), ("coefficients", list_coefficients(spec))):
            block = re.compile(rf"(?<=<!-- {name} -->\n).*?(?=<!-- end -->)", re.DOTALL)
            if not block.search(text):
                raise SystemExit(f"{path} has no place for its {name}: <!-- {name} --> and <!-- end -->")
            text = block.sub(lambda _, lines=lines: "\n".join([*lines, ""]), text, count=1)
        pages[path] = text
    answer = json.dumps(describe_methods().dump(), indent=1, ensure_ascii=False)
    return {**pages, CLIENT: f"{answer}\n"}


def list_parameters(spec: method.MethodSpec) -> Iterable[str]:
    """Return the lines of the table of a method's parameters."""
    yield "| name | default | range | meaning |"
    yield "|---|---|---|---|"
    for each in spec.parameters:
        for row in (each, *each.members):
            yield _format_row(row, within="" if row is each else f"{each.name}.")
    yield "| `exclude` | no frame | | Frames that the fit leaves out, each with the reason. |"


def list_coefficients(spec: method.MethodSpec) -> Iterable[str]:
    """Return the lines of the table of a method's coefficients."""
    yield "| name | unit | coefficient |"
    yield "|---|---|---|"
    for each in spec.coefficients:
        yield f"| `{each.name}` | {' or '.join(each.units)} | {each.label} |"


def _format_row(parameter: parameters.Parameter, *, within: str) -> str:
    allowed = ", ".join(f"`{choice.value}`" for choice in parameter.choices) or parameter.range_text
    if parameter.none_allowed:
        allowed += ", or `none`"
    if names := parameter.suggest():
        allowed = f"{', '.join(f'`{name}`' for name in names)}, or a table"
    default = parameter.default_text or f"`{parameter.default_shown}`"
    if parameter.kind in ("number", "interval") and parameter.unit != "1":
        allowed += f" {parameter.unit}"
    stated = " Stated by the campaign." if parameter.given_by == "campaign" else ""
    # a number's first sentence: the others, such as where a default comes from, are in its form
    sentence, stop, _ = parameter.description.partition(". ")
    told = parameter.description if parameter.choices or not stop else f"{sentence}."
    description = f"{told}{stated}".replace("|", "\\|")
    return f"| `{within}{parameter.name}` | {default} | {allowed} | {description} |"


if __name__ == "__main__":
    for page, text in render().items():
        page.write_text(text, encoding="utf-8")
