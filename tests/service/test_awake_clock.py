"""A clock that stands still while its loop is stopped."""

from service.launch.supervisor import AwakeClock


def test_a_turn_counts_at_most_its_longest_time():
    now = [100.0]
    clock = AwakeClock(2.0, clock=lambda: now[0])
    for seconds in (1.0, 1.5, 3600.0, 1.0):
        now[0] += seconds
        clock.turn()
    assert clock.now_s == 1.0 + 1.5 + 2.0 + 1.0
