"""Words that the tab key completes: what the client knows, and the campaigns and cameras of the service."""

from collections.abc import Callable, Iterator
from contextlib import suppress

from stilb.client import Client
from stilb.commands.output import config_folder
from stilb.field.files import ROLES
from stilb.field.template import read_methods
from stilb.login import choose_login, read_login
from stilb.method import DEFAULT_METHOD
from stilb.problem import Problem, Unclear

_WITHIN_S = 2.0
_MOST = 200


def complete_role(incomplete: str) -> list[str]:
    return [role for role in ROLES if role.startswith(incomplete)]


def complete_method(incomplete: str) -> list[str]:
    return [name for name in read_methods() if name.startswith(incomplete)]


def complete_model(incomplete: str) -> list[str]:
    """Return the models of the default method's fit."""
    (model,) = [each for each in read_methods()[DEFAULT_METHOD]["parameters"] if each["name"] == "model"]
    return [each["value"] for each in model["choices"] if each["value"].startswith(incomplete)]


def complete_campaign(incomplete: str) -> list[str]:
    """Return project numbers, else ids, of the service that this user is signed in to."""
    return _ask(lambda client: (each.project_number or each.id for each in client.campaigns()), incomplete)


def complete_camera(incomplete: str) -> list[str]:
    return _ask(lambda client: (each.serial for each in client.cameras()), incomplete)


def _ask(list_names: Callable[[Client], Iterator[str]], incomplete: str) -> list[str]:
    """Return what the service lists; nothing, soon and without a word, where it cannot be asked."""
    found = dict[str, None]()
    with suppress(Problem, Unclear, OSError):
        login = choose_login(read_login(config_folder()), url=None, key=None)
        with Client(login.url, login.key, timeout=_WITHIN_S, retries=0) as client:
            for name in list_names(client):
                if name.startswith(incomplete):
                    found[name] = None
                if len(found) == _MOST:
                    break
    return list(found)
