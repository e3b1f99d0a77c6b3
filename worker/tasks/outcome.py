"""Outcome of a task: how to store what it computed, and whether the input was refused."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from sqlalchemy.orm import Session

from radiometry.findings import InputRejected


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """``store`` runs in the transaction that ends the job, perhaps twice, and returns the job's result."""

    store: Callable[[Session], dict[str, Any]]
    rejection: InputRejected | None = None
