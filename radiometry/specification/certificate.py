"""Certificate text of a method: procedure, equation, traceability and columns of its points."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

Form = Literal["text", "number", "percent"]


@dataclass(frozen=True, kw_only=True)
class Column:
    """One printed value of a point. ``name`` : its field; ``share`` : relative width of the column."""

    name: str
    head: str
    form: Form = "number"
    share: float = 1.0


@dataclass(frozen=True, kw_only=True)
class CertificateText:
    """Certificate text of one method.

    ``headlines`` : coefficients on the first page; all others have a table of their own
    ``layout`` : "curve" for a method that fits a curve per ISO value, with sheets of its own
    ``traceability`` : "" where it depends on the meters or panels used
    ``vignetting`` : what corrected the signals, where no vignetting version did
    ``holds_for_lens`` : the result is valid for one lens; a certificate without a lens then has a gap
    ``statements`` : statements that only this method makes
    ``state`` : ``(parameters, result) -> tuple of str``, those that depend on the version
    """

    procedure: str
    equation: str
    headlines: frozenset[str]
    columns: tuple[Column, ...]
    layout: Literal["general", "curve"] = "general"
    traceability: str = ""
    vignetting: str = "none"
    holds_for_lens: bool = True
    statements: tuple[str, ...] = ()
    state: Callable[[Mapping[str, Any], Mapping[str, Any]], tuple[str, ...]] = lambda *_: ()


FRAME: Final = Column(name="frame", head="frame", form="text", share=2.4)
