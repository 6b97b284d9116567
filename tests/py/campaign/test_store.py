"""The store of results: what is written is whole, comes back as it was, and says what it was computed from."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from psabench.campaign.store import KIND, Origin, Part, Rows, Store
from psabench.errors import BadInput

ORIGIN = Origin(
    kind="dice",
    input={"sides": 6, "names": ["a", "é"]},
    seed=7,
    version="1",
    build="b1",
    columns=("sum_deg", "error_deg"),
)


def rows(first: int, count: int) -> Rows:
    """What a run is follows from its number."""
    k = np.arange(first, first + count, dtype=np.float32)
    return np.stack([k, -k / 3], axis=1)


def part(first: int, count: int, origin: Origin = ORIGIN) -> Part:
    return Part(origin=origin, first_run=first, rows=rows(first, count))


def test_rows_come_back_whatever_the_order_of_the_parts(tmp_path: Path) -> None:
    with Store(tmp_path / "new" / "s.sqlite") as store:
        store.put([part(100, 50)])
        store.put([part(0, 100), part(150, 7)])
    with Store(tmp_path / "new" / "s.sqlite") as store:
        assert store.runs(ORIGIN) == {0: 100, 100: 50, 150: 7}
        assert np.array_equal(store.rows(ORIGIN, 157), rows(0, 157))
        assert np.array_equal(store.rows(ORIGIN, 120), rows(0, 120))
        assert store.rows(ORIGIN, 0).shape == (0, 2)
        assert store.origins() == [ORIGIN]


def test_each_part_of_an_origin_is_part_of_its_key(tmp_path: Path) -> None:
    others = [
        replace(ORIGIN, kind="cards"),
        replace(ORIGIN, input={"sides": 8}),
        replace(ORIGIN, seed=8),
        replace(ORIGIN, version="2"),
        replace(ORIGIN, build="b2"),
        replace(ORIGIN, columns=("sum_deg", "error_rad")),
    ]
    assert len({ORIGIN.key, *(o.key for o in others)}) == 7
    assert replace(ORIGIN, input={"names": ["a", "é"], "sides": 6}).key == ORIGIN.key  # the order of keys means nothing
    with Store(tmp_path / "s") as store:
        store.put([part(0, 3)])
        assert all(store.runs(o) == {} for o in others)


def test_builds_have_series_of_their_own(tmp_path: Path) -> None:
    """A part of each: never rows of both in one series, whichever asks for more."""
    b2, b3, other = replace(ORIGIN, build="b2"), replace(ORIGIN, build="b3", version="2"), replace(ORIGIN, seed=8)
    with Store(tmp_path / "s") as store:
        store.put([part(0, 4), replace(part(0, 2, b2), rows=rows(0, 2) + 1), part(0, 3, b3), part(0, 9, other)])
        store.put([replace(part(2, 4, b2), rows=rows(2, 4) + 1)])
        assert store.runs(ORIGIN) == {0: 4}
        assert np.array_equal(store.rows(ORIGIN, 4), rows(0, 4))
        assert np.array_equal(store.rows(b2, 6), rows(0, 6) + 1)
        assert store.others(ORIGIN) == {"b2": 6, "b3": 3}
        assert store.others(b2) == {"b1": 4, "b3": 3}
        assert store.others(other) == {}
        store.forget_others(ORIGIN)
        assert store.origins() == [ORIGIN, other]
        assert store.others(ORIGIN) == {}


def test_a_store_of_format_1_is_kept_and_not_used(tmp_path: Path) -> None:
    """Its key had no build, so that a series could hold runs of several."""
    path = tmp_path / "s"
    with Store(path) as store:
        store.put([part(0, 5)])
    with sqlite3.connect(path) as db:
        db.execute("UPDATE series SET key = 'as format 1 made it', build = '0123456789abcdef'")
        db.execute("PRAGMA user_version = 1")
    with Store(path) as store:
        assert store.runs(ORIGIN) == {}
        assert store.others(ORIGIN) == {"0123456789abcdef": 5}
        store.put([part(0, 2)])
        assert np.array_equal(store.rows(ORIGIN, 2), rows(0, 2))
    with sqlite3.connect(path) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (KIND.format,)


def test_a_part_grows_and_a_series_can_be_forgotten(tmp_path: Path) -> None:
    other = replace(ORIGIN, seed=8)
    with Store(tmp_path / "s") as store:
        store.put([part(0, 3), part(0, 4, other)])
        store.put([part(0, 10)])
        assert store.runs(ORIGIN) == {0: 10}
        store.forget(ORIGIN)
        assert store.runs(ORIGIN) == {}
        assert store.origins() == [other]
        assert np.array_equal(store.rows(other, 4), rows(0, 4))
    with sqlite3.connect(tmp_path / "s") as db:
        assert db.execute("SELECT count(*) FROM part").fetchone() == (1,)


def test_parts_may_overlap(tmp_path: Path) -> None:
    """As when a later version cuts the work in other pieces."""
    with Store(tmp_path / "s") as store:
        store.put([part(0, 10), part(10, 10), part(0, 15), part(15, 10), part(16, 4)])
        assert np.array_equal(store.rows(ORIGIN, 25), rows(0, 25))


def test_missing_and_damaged_runs_are_refused(tmp_path: Path) -> None:
    with Store(tmp_path / "s") as store:
        store.put([part(0, 10), part(20, 10)])
        with pytest.raises(BadInput, match="expected 30 runs, got 10"):
            store.rows(ORIGIN, 30)
        with sqlite3.connect(tmp_path / "s") as db:
            db.execute("UPDATE part SET data = CAST(substr(data, 1, 79) || x'FF' AS BLOB) WHERE first_run = 0")
        with pytest.raises(BadInput, match="expected runs 0 to 9 of dice, got damage"):
            store.rows(ORIGIN, 10)


def test_what_is_not_finite_is_no_input() -> None:
    with pytest.raises(ValueError, match="not JSON compliant"):
        _ = replace(ORIGIN, input={"x": float("nan")}).key


def test_rows_that_do_not_fit_the_columns_change_nothing(tmp_path: Path) -> None:
    with Store(tmp_path / "s") as store:
        with pytest.raises(ValueError, match="expected rows of 2 columns"):
            store.put([part(0, 3), replace(part(3, 3), rows=np.zeros((3, 1), np.float32))])
        assert store.runs(ORIGIN) == {}
        assert store.origins() == []


def _text(path: Path) -> None:
    path.write_text("not a database, and longer than the header of one would be: 100 bytes of it\n" * 3)


def _foreign(path: Path) -> None:
    with sqlite3.connect(path) as db:
        db.execute("CREATE TABLE recipes (name TEXT)")


def _newer(path: Path) -> None:
    with Store(path):
        pass
    with sqlite3.connect(path) as db:
        db.execute(f"PRAGMA user_version = {KIND.format + 1}")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (_text, "expected a store of results"),
        (_foreign, "an SQLite file of another program"),
        (_newer, f"expected a store of results of format {KIND.format}, got format {KIND.format + 1}"),
        (Path.mkdir, "expected a store of results .SQLite."),
    ],
)
def test_a_file_that_is_no_store_is_refused_and_left_alone(tmp_path: Path, make: object, words: str) -> None:
    path = tmp_path / "s"
    assert callable(make)
    make(path)
    before = path.read_bytes() if path.is_file() else None
    with pytest.raises(BadInput, match=words):
        Store(path)
    assert before is None or path.read_bytes() == before


DYING = """
import os, signal, sys
from pathlib import Path
sys.path[:0] = {path!r}
from test_store import part
from psabench.campaign.store import Store
def parts():
    yield part(3, 1000)
    yield part(1003, 1000)
    os.kill(os.getpid(), signal.SIGKILL)
store = Store(Path(sys.argv[1]))
store.put([part(0, 3)])
store.put(parts())
"""


def test_a_writer_that_is_killed_leaves_only_whole_parts(tmp_path: Path) -> None:
    path = tmp_path / "s"
    code = DYING.format(path=[str(Path(__file__).parent)])
    died = subprocess.run([sys.executable, "-c", code, str(path)], timeout=60, check=False)
    assert died.returncode == -signal.SIGKILL
    with Store(path) as store:
        assert store.runs(ORIGIN) == {0: 3}
        assert np.array_equal(store.rows(ORIGIN, 3), rows(0, 3))


def test_a_store_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    path = tmp_path / "s"
    with Store(path) as store, sqlite3.connect(path, isolation_level=None) as other:
        store._db.execute_sql("PRAGMA busy_timeout = 0")
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(BadInput, match="database is locked"):
            store.put([part(0, 3)])
        other.execute("ROLLBACK")
        store.put([part(0, 3)])
        assert store.runs(ORIGIN) == {0: 3}


def test_the_file_is_plain_sqlite(tmp_path: Path) -> None:
    """What docs/store.md says: any SQLite can read it."""
    path = tmp_path / "s"
    with Store(path) as store:
        store.put([part(0, 5)])
    with sqlite3.connect(path) as db:
        kind, text, columns = db.execute("SELECT kind, input, columns FROM series").fetchone()
        (data,) = db.execute("SELECT data FROM part").fetchone()
    assert (kind, json.loads(text), json.loads(columns)) == ("dice", ORIGIN.input, list(ORIGIN.columns))
    assert np.array_equal(np.frombuffer(data, "<f4").reshape(-1, 2), rows(0, 5))
    assert sorted(os.listdir(tmp_path)) == ["s"]


@settings(deadline=None, max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sizes=st.lists(st.integers(1, 9), min_size=1, max_size=8), data=st.data())
def test_any_order_of_parts_gives_the_same_rows(tmp_path: Path, sizes: list[int], data: st.DataObject) -> None:
    starts = [sum(sizes[:i]) for i in range(len(sizes))]
    order = data.draw(st.permutations(range(len(sizes))))
    with Store(tmp_path / "s") as store:
        store.forget(ORIGIN)
        for i in order:
            store.put([part(starts[i], sizes[i])])
        assert np.array_equal(store.rows(ORIGIN, sum(sizes)), rows(0, sum(sizes)))
