"""A tenth of the matrix, with quick leases and short faults; `make faults` drills all of it."""

from dataclasses import replace

from tests.faults import report
from tests.faults.drill import BOTH
from tests.faults.matrix import Matrix
from tests.faults.table import FAULTS, HASTEN, QUIET
from tests.support.campaigns import LEVELS
from tests.support.deployments import QUICK
from tests.support.fieldwork import write_campaign


def test_nothing_is_lost_doubled_or_wrong(tmp_path):
    (tmp_path / "shots").mkdir()
    shots = write_campaign(tmp_path / "shots")
    half, scenes = len(shots) // 2, 1 + len(LEVELS)
    base, card = shots[:scenes], shots[half : half + scenes]
    quick = {"settings": QUICK, "hasten": HASTEN}
    matrix = Matrix(base=base, card=card, folder=tmp_path / "rows", seed=1, **quick)
    # the truth of one deployment is that of the other
    drilled = [replace(QUIET, on=BOTH[:1]), *(replace(fault, on=fault.in_tests) for fault in FAULTS)]
    matrix.run([fault for fault in drilled if fault.on], BOTH)
    complaints = [f"{row.fault}: {complaint}" for row in matrix.rows for complaint in report.complaints(row)]
    assert not complaints, "\n".join(complaints)
    assert not [row.skipped for row in matrix.rows if row.skipped]


def test_a_tenth_of_the_matrix_is_drilled_here():
    rows = sum(len(fault.on) for fault in FAULTS)
    assert sum(len(fault.in_tests) for fault in FAULTS) >= rows / 10


def test_every_fault_has_a_name_of_its_own_and_its_deployments():
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 16
    assert all(set(fault.in_tests) <= set(fault.on) <= set(BOTH) for fault in FAULTS)
