"""A unit's flights in its passport: what is lost when the power is, at any instant, and what is rejected."""

from __future__ import annotations

import multiprocessing
import os
import sqlite3
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from psabench.errors import BadInput
from psabench.koi.autocal import FlightEstimate, InstrumentClass, RollBack, knowledge_after
from psabench.koi.flight_log import begin_flight, end_flight, read_log, roll_back
from psabench.passport.store import PassportStore

NAMES = ("nu1_radps", "df1_mps2")
KIND = InstrumentClass(
    names=NAMES, persistent_sd=np.array([5e-8, 1e-3]), run_sd=np.array([2e-8, 3e-4]), aging_sd=np.zeros(2)
)
DAY = datetime(2026, 5, 1, 6, 30, tzinfo=UTC)


def estimate_of(k: int, weight: float = 1.0) -> FlightEstimate:
    p = np.array([[1e-16, 1e-13], [1e-13, 1e-8]]) * (1 + k / 7)
    x = np.array([1e-8 / 3, -2e-4]) * (k + 1)
    time_s = (DAY + timedelta(days=k)).timestamp()
    return FlightEstimate(serial="S7", names=NAMES, time_s=time_s, x=x, covariance=p, weight=weight)


def fly_flight(store: PassportStore, k: int, weight: float = 1.0, verdict: str = "") -> None:
    key = begin_flight(store, "S7", "sins", DAY + timedelta(days=k))
    end_flight(store, "sins", key, estimate_of(k, weight), verdict=verdict)


def test_flights_come_back_to_the_bit_and_roll_back_by_number(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "units.sqlite") as store:
        for k in range(3):
            fly_flight(store, k, weight=0.0 if k == 1 else 1.0, verdict="outage" if k == 1 else "")
        begin_flight(store, "S7", "sins", DAY + timedelta(days=3))
        fly_flight(store, 4)
        log = read_log(store, "S7")
        assert log.verdicts == ("", "outage", "", "")
        assert log.incomplete == ("2026-05-04T06:30:00+00:00",)
        for k, event in zip((0, 1, 2, 4), log.events, strict=True):
            assert isinstance(event, FlightEstimate)
            want = estimate_of(k, weight=0.0 if k == 1 else 1.0)
            assert np.array_equal(event.x, want.x)
            assert np.array_equal(event.covariance, want.covariance)
            assert (event.weight, event.time_s) == (want.weight, want.time_s)
        roll_back(store, "S7", "sins", 1, DAY + timedelta(days=6))
        found = knowledge_after(KIND, "S7", read_log(store, "S7").events)
        want_known = knowledge_after(KIND, "S7", [*log.events, RollBack(1)])
        assert np.array_equal(found.p, want_known.p)
        assert found.flights == 1
        assert read_log(store, "unknown").events == ()


@pytest.mark.parametrize(
    ("do", "said"),
    [
        (lambda s: begin_flight(s, "S7", "sins", DAY), "expected a beginning after 2026-05-01T06:30"),
        (lambda s: begin_flight(s, "S7", "sins", DAY - timedelta(seconds=1)), "expected a beginning after 2026-05-01"),
        (lambda s: begin_flight(s, "S7", "sins", datetime(2027, 1, 1)), "expected a time with its zone"),
        (lambda s: end_flight(s, "sins", "x", estimate_of(0)), "expected a flight that has begun, got x"),
        (lambda s: end_flight(s, "sins", DAY.isoformat(), estimate_of(0)), "expected a flight that is not over"),
        (lambda s: end_flight(s, "sins", "x", estimate_of(0), verdict="outage"), "expected weight 0, got weight 1"),
        (lambda s: end_flight(s, "sins", "x", estimate_of(0, 0.0)), "expected a verdict for weight 0"),
        (lambda s: roll_back(s, "S7", "sins", 2, DAY), "expected a flight of 0 to 1, got 2"),
        (lambda s: fly_other(s), "expected a unit of type sins, got mems"),
    ],
)
def test_what_does_not_follow_is_rejected_and_nothing_enters(do: object, said: str, tmp_path: Path) -> None:
    with PassportStore(tmp_path / "units.sqlite") as store:
        fly_flight(store, 0)
        with pytest.raises(BadInput, match=said):
            do(store)  # type: ignore[operator]
        assert len(read_log(store, "S7").events) == 1
        assert read_log(store, "S7").incomplete == ()


def test_a_flight_ends_at_its_own_time_and_before_another_begins(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "units.sqlite") as store:
        first = begin_flight(store, "S7", "sins", DAY)
        with pytest.raises(BadInput, match=r"expected a flight that began at 1777617000\.0 s, got 1777703400.0"):
            end_flight(store, "sins", first, estimate_of(1))
        begin_flight(store, "S7", "sins", DAY + timedelta(days=1))
        with pytest.raises(BadInput, match="expected the last flight, 2026-05-02T06:30"):
            end_flight(store, "sins", first, estimate_of(0))
        assert read_log(store, "S7").incomplete == ("2026-05-01T06:30:00+00:00", "2026-05-02T06:30:00+00:00")


def fly_other(store: PassportStore) -> None:
    begin_flight(store, "S7", "mems", DAY + timedelta(days=1))


def test_an_entry_that_is_none_is_named(tmp_path: Path) -> None:
    path = tmp_path / "units.sqlite"
    with PassportStore(path) as store:
        fly_flight(store, 0)
    with sqlite3.connect(path) as db:
        db.execute("UPDATE run SET provenance = '{}' WHERE number = 2")
    with (
        PassportStore(path) as store,
        pytest.raises(BadInput, match="S7@2: expected an entry of a flight with the key 'flight'"),
    ):
        read_log(store, "S7")


def test_a_flight_without_a_covariance_is_named(tmp_path: Path) -> None:
    path = tmp_path / "units.sqlite"
    with PassportStore(path) as store:
        fly_flight(store, 0)
    with sqlite3.connect(path) as db:
        db.execute("DELETE FROM covariance")
    with PassportStore(path) as store, pytest.raises(BadInput, match="S7@2: expected a covariance, got none"):
        read_log(store, "S7")


def _season(path: Path, until: int) -> None:
    """Flies until the given write to the store's files, then is gone as when the power is lost."""
    count = 0

    def trace(_: str) -> None:
        nonlocal count
        count += 1
        if count == until:
            os._exit(9)

    with PassportStore(path) as store:
        store._db._db.set_trace_callback(trace)  # each statement, those of transactions too
        for k in range(2):
            fly_flight(store, k)
    os._exit(0)


def test_the_power_may_go_at_any_statement_of_a_season(tmp_path: Path) -> None:
    """Of each flight there is nothing, a beginning, or the whole; then the season goes on."""
    seen, until, status = set[tuple[int, int]](), 0, 9
    while status == 9:
        until += 1
        path = tmp_path / f"{until}.sqlite"
        p = multiprocessing.get_context("fork").Process(target=_season, args=(path, until))
        p.start()
        p.join(60)
        assert p.exitcode is not None
        status = p.exitcode
        with PassportStore(path) as store:
            log = read_log(store, "S7")
            seen.add((len(log.events), len(log.incomplete)))
            assert len(log.incomplete) <= 1
            for k, event in enumerate(log.events):
                assert isinstance(event, FlightEstimate)
                assert np.array_equal(event.covariance, estimate_of(k).covariance)
            fly_flight(store, 9)
            assert len(read_log(store, "S7").events) == len(log.events) + 1
    assert seen == {(0, 0), (0, 1), (1, 0), (1, 1), (2, 0)}
