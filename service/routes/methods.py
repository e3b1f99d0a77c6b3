"""The calibration methods: what each takes and reports."""

from fastapi import Response

from service.auth import Reader
from service.operations import Router
from service.routes import problems
from service.schemas.methods import MethodsAnswer, describe_methods

router = Router(prefix="/v1/methods", tags=["calibrations"])


@router.get("", response_model=MethodsAnswer, responses=problems())
def list_methods(_caller: Reader) -> Response:
    """List the calibration methods with their roles, parameters and coefficients.

    The forms of the pages and of the command line are made from this answer.
    """
    return describe_methods().respond()
