"""What a demo stands on: a service, a folder for its files, and somebody who watches."""

from dataclasses import dataclass
from pathlib import Path

import stilb
from demo.display import Display


@dataclass(frozen=True, kw_only=True)
class Stage:
    """``quick`` : small frames and few of them, as a test has time for."""

    client: stilb.Client
    folder: Path
    display: Display
    quick: bool = False
