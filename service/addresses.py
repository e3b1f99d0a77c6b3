"""Which routes an address fits, and which of them it is one of."""

import re
from dataclasses import dataclass

from fastapi import FastAPI
from fastapi.routing import iter_route_contexts


@dataclass(frozen=True)
class _Template:
    path: str
    pattern: re.Pattern[str]
    methods: frozenset[str]


class Addresses:
    """The templates of an application's routes, its pages' too.

    Made of a whole application: the framework then builds its routes, which takes a third of a second of a
    processor, before the first request and not within it.
    """

    def __init__(self, app: FastAPI) -> None:
        self._templates = [
            _Template(context.path, context.path_regex, frozenset(context.methods or ()))
            for context in iter_route_contexts(app.routes)
            if context.path is not None
        ]
        self._rivals: dict[str, list[_Template]] = {}

    def methods_of(self, address: str) -> list[str]:
        """Return every method of an address; the framework names those of the first route that it finds."""
        fitting = [each for each in self._templates if self.is_of(each.path, address)]
        methods = {method for each in fitting for method in each.methods}
        return sorted(methods | {"HEAD"} if "GET" in methods else methods)

    def is_of(self, path: str, address: str) -> bool:
        """Return whether an address is one of this template: `/keys/own` is none of `/keys/{key_id}`."""
        if path not in self._rivals:
            self._rivals[path] = [each for each in self._templates if self._is_narrower(each, path)]
        own = next(each for each in self._templates if each.path == path)
        return bool(own.pattern.match(address)) and not any(
            rival.pattern.match(address) for rival in self._rivals[path]
        )

    def _is_narrower(self, template: _Template, path: str) -> bool:
        own = next(each for each in self._templates if each.path == path)
        return bool(own.pattern.match(template.path)) and not template.pattern.match(path)
