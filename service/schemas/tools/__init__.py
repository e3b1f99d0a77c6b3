"""The calculators: what they take and what they answer."""

from typing import Any

from service.schemas.tools.coverage import CoverageAnswer, NewCoverage
from service.schemas.tools.exposure import ExposureAnswer, ExposureTable
from service.schemas.tools.motion import MotionAnswer, NewMotion


def describe_tools() -> dict[str, dict[str, Any]]:
    """Return the schemas of each calculator, as its page asks and shows."""
    return {
        name: {
            "form": form.model_json_schema(),
            "answer": answer.model_json_schema(),
            "takes_table": form is ExposureTable,
        }
        for name, form, answer in (
            ("motion", NewMotion, MotionAnswer),
            ("coverage", NewCoverage, CoverageAnswer),
            ("exposure", ExposureTable, ExposureAnswer),
        )
    }
