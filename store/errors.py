"""What the store refuses, whoever asks."""


class Conflict(Exception):  # noqa: N818  it says what happened
    """The request contradicts what is recorded; the message says what."""

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
