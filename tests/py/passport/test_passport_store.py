"""Passports: a run enters whole or not at all, a later one supersedes, and what is read back is what was entered."""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from jsonschema import Draft202012Validator
from psabench.errors import BadInput, OutputError
from psabench.passport.document import passport_dict
from psabench.passport.store import KIND, PassportStore, find_run
from psabench.places import CHECKOUT
from psabench.thermal.compensation import compensation_dict
from unit_runs import FITTED, make_run

SEED = 27


def test_what_is_read_is_what_was_entered(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "p") as store:
        assert [store.put_run("QA-1", "quartz", make_run(n)) for n in (1, 2)] == [1, 2]
        assert store.put_run("QA-1", "quartz", make_run(3, "reversal quiet")) == 3
    with PassportStore(tmp_path / "p", read_only=True) as store:
        p = store.read_passport("QA-1")
        assert store.unit_serials() == ["QA-1"]
    all_entered = make_run(1), make_run(2), make_run(3, "reversal quiet")
    for entered, found, gone in zip(all_entered, p.runs, (None, 1, None), strict=True):
        assert found.supersedes == gone
        plain = replace(found, number=0, supersedes=None, quantities=entered.quantities)
        assert plain == entered
        for q, back in zip(entered.quantities, found.quantities, strict=True):
            assert replace(back, compensation=None) == replace(q, compensation=None)
            assert (q.compensation is None) == (back.compensation is None)
    first = p.runs[0].quantities[0].compensation
    assert first is not None
    assert compensation_dict(first) == compensation_dict(FITTED)
    assert [run.number for run in p.current_runs()] == [2, 3]


def test_the_same_data_enter_once(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "p") as store:
        assert [store.put_run("QA-1", "quartz", make_run(n)) for n in (1, 2, 1, 2)] == [1, 2, 1, 2]
        assert len(store.read_passport("QA-1").runs) == 2
        assert store.put_run("QA-2", "quartz", make_run(1)) == 1  # of another unit: its own run


def test_runs_by_name(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "p") as store:
        store.put_run("QA-1", "quartz", make_run(1))
        store.put_run("QA-1", "quartz", make_run(2))
        assert [find_run(store, n).number for n in ("QA-1@1", "QA-1@2")] == [1, 2]
        for name, says in (("QA-1@3", "a run of 1 to 2, got 3"), ("QB", "a serial number of the store, got QB")):
            with pytest.raises(BadInput, match=says):
                find_run(store, name)


def test_the_run_that_began_last_is_valid_in_any_order_of_entry(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "p") as store:
        for n in (2, 1, 3):
            store.put_run("QA-1", "quartz", make_run(n))
        p = store.read_passport("QA-1")
        assert [(run.seed, run.supersedes) for run in p.runs] == [(2, None), (1, None), (3, 1)]
        assert [run.seed for run in p.current_runs()] == [3]
        store.put_run("QA-1", "quartz", make_run(4, "reversal quiet"))
        assert find_run(store, "QA-1").seed == 4
        assert find_run(store, "QA-1", lambda run: run.method == "turns quiet").seed == 3


def test_a_seed_of_64_bits_is_kept(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "p") as store:
        store.put_run("QA-1", "quartz", replace(make_run(1), seed=2**64 - 1))
        assert store.read_passport("QA-1").runs[0].seed == 2**64 - 1


def test_the_page_shows_a_query_that_works(tmp_path: Path) -> None:
    page = (CHECKOUT / "docs/tools/passports.md").read_text()
    query = page.partition("```sql\n")[2].partition("```")[0]
    with PassportStore(tmp_path / "p") as store:
        store.put_run("QA-1", "quartz", make_run(1))
    with sqlite3.connect(tmp_path / "p") as db:
        assert db.execute(query).fetchone() == ("QA-1", 1, "q0_v", 1.0, 1e-6)


def test_the_export_follows_its_schema(tmp_path: Path) -> None:
    schema = json.loads((CHECKOUT / "proto/passport.schema.json").read_text())
    Draft202012Validator.check_schema(schema)
    with PassportStore(tmp_path / "p") as store:
        store.put_run("QA-1", "quartz", make_run(1))
        store.put_run("QA-1", "quartz", replace(make_run(2), covariance=None, range_c=None, seed=None, within=None))
        made = json.loads(json.dumps(passport_dict(store.read_passport("QA-1"))))
    validator = Draft202012Validator(schema)
    validator.validate(made)
    made["runs"][0]["estimates"][0]["ci95"] = [1.0]
    assert not validator.is_valid(made)


KILLED = """
import sys
sys.path.insert(0, {here!r})
from pathlib import Path
from psabench.passport.store import PassportStore
from unit_runs import make_run
with PassportStore(Path(sys.argv[1])) as store:
    print("open", flush=True)
    for n in range(1, 100_000):
        store.put_run("QA-1", "quartz", make_run(n, count=40))
        print(n, flush=True)
"""


def test_a_writer_that_is_killed_at_any_instant_leaves_whole_runs(tmp_path: Path) -> None:
    rng = Random(SEED)
    path = tmp_path / "p"
    for _ in range(4):
        child = subprocess.Popen(
            [sys.executable, "-c", KILLED.format(here=str(CHECKOUT / "tests/py/support")), str(path)],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert child.stdout is not None
        told = 0
        for line in child.stdout:
            told = 0 if line == "open\n" else int(line)
            if told >= rng.randrange(1, 6):
                break
        child.send_signal(signal.SIGKILL)  # in the middle of the next one
        told = max([told, *(int(line) for line in child.stdout if line.strip().isdigit())])
        assert child.wait() == -signal.SIGKILL
        with PassportStore(path, read_only=True) as store:
            runs = store.read_passport("QA-1").runs
        assert len(runs) >= told, f"seed {SEED}"
        assert all(len(run.quantities) == 40 and run.covariance for run in runs)
        assert [run.number for run in runs] == list(range(1, len(runs) + 1))


def _foreign(path: Path) -> None:
    with sqlite3.connect(path) as db:
        db.execute("CREATE TABLE a (b)")


def _newer(path: Path) -> None:
    with PassportStore(path), sqlite3.connect(path) as db:
        db.execute(f"PRAGMA user_version = {KIND.format + 1}")


def _text(path: Path) -> None:
    path.write_text("serial: QA-1\n" * 100)


@pytest.mark.parametrize("read_only", [False, True])
@pytest.mark.parametrize(
    ("make", "says"),
    [
        (_foreign, "an SQLite file of another program"),
        (_newer, f"a store of passports of format {KIND.format}, got format {KIND.format + 1}"),
        (_text, "a store of passports, got a damaged or other file"),
    ],
)
def test_a_file_that_is_no_store_is_left_alone(tmp_path: Path, make: object, says: str, read_only: bool) -> None:
    path = tmp_path / "p"
    assert callable(make)
    make(path)
    before = path.read_bytes()
    with pytest.raises(BadInput, match=says):
        PassportStore(path, read_only=read_only)
    assert path.read_bytes() == before


def test_reading_makes_and_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "p"
    with pytest.raises(BadInput, match="expected a store of passports, got no such file"):
        PassportStore(path, read_only=True)
    assert not path.exists()
    with PassportStore(path) as store:
        store.put_run("QA-1", "quartz", make_run(1))
    before = path.read_bytes()
    with (
        PassportStore(path, read_only=True) as store,
        pytest.raises((BadInput, OutputError), match="got one without permission"),
    ):
        store.put_run("QA-1", "quartz", make_run(2))
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["p"]


def put_many(store: PassportStore, count: int) -> None:
    for n in range(2, count):
        store.put_run("QA-1", "quartz", make_run(n, count=40))


def test_a_full_disk_leaves_the_store_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "p"
    with PassportStore(path) as store:
        store.put_run("QA-1", "quartz", make_run(1))
        pages = store._db.first_value("PRAGMA page_count")
        store._db.execute_sql(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(OutputError, match=r"full"):
            put_many(store, 50)
        store._db.execute_sql("PRAGMA max_page_count = 1000000")
        runs = store.read_passport("QA-1").runs
        assert store.put_run("QA-1", "quartz", make_run(60)) == len(runs) + 1


@pytest.mark.parametrize("serial", ["", " QA", "QA\n1", "Q" * 65, "QA@1"])
def test_a_serial_number_is_short_and_printable(tmp_path: Path, serial: str) -> None:
    with PassportStore(tmp_path / "p") as store, pytest.raises(BadInput, match="serial number: expected"):
        store.put_run(serial, "quartz", make_run(1))


def test_a_unit_keeps_its_type(tmp_path: Path) -> None:
    with PassportStore(tmp_path / "p") as store:
        store.put_run("QA-1", "quartz", make_run(1))
        with pytest.raises(BadInput, match="QA-1: expected a unit of type quartz, got mems"):
            store.put_run("QA-1", "mems", make_run(2))
        assert len(store.read_passport("QA-1").runs) == 1
