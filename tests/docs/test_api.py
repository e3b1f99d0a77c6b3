"""The HTTP interface keeps what the last release promised."""

import importlib.util

import pytest

from tests.support.compose import ROOT


@pytest.fixture(scope="module")
def api():
    spec = importlib.util.spec_from_file_location("api", ROOT / "docs" / "api.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_no_break_is_undecided_and_no_decision_is_idle(api):
    breaks = set(api.find_breaks(api.read_lines(api.RELEASED), api.list_promises(api.build_current())))
    assert breaks == api.read_lines(api.DECIDED)


def test_what_breaks_clients_is_told_from_what_is_added(api):
    def promise(**schema):
        operation = {"operationId": "get_a", "responses": {"200": {"content": {"application/json": {}}}}}
        schemas = {"Made": {"properties": {"id": {"type": "string"}}, "required": ["id"]}, **schema}
        return api.list_promises({"paths": {"/v1/a": {"get": operation}}, "components": {"schemas": schemas}})

    form = {"properties": {"name": {}}, "additionalProperties": False}
    released = promise(NewMade=form)
    assert (
        api.find_breaks(released, promise(NewMade=form, Other={"properties": {"x": {}}, "required": ["x"]}))
        == []
    )
    assert api.find_breaks(released, promise(NewMade=form | {"required": ["name"]})) == [
        "+ NewMade.name must be sent"
    ]
    optional = {"properties": {"id": {"type": "string"}}}
    assert api.find_breaks(released, promise(NewMade=form, Made=optional)) == ["- Made.id is always there"]
    assert "- NewMade.name" in api.find_breaks(released, promise())
    number = {"properties": {"id": {"type": "number"}}, "required": ["id"]}
    assert api.find_breaks(released, promise(NewMade=form, Made=number)) == ["- Made.id may be string"]
