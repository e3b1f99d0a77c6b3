"""Errors that the store raises, whoever asks."""


class Conflict(Exception):  # noqa: N818  it says what happened
    """The request contradicts what is recorded; the message says what."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message


class ConnectionLost(Exception):  # noqa: N818  it is what happened
    """A connection of the driver's own ended, or was not answered."""
