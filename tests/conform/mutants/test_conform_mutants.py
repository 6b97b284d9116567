"""A few mutants of `make mutants`, built and checked: the suite's teeth are looked at in every run of the tests."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.mutants.declared import Mutant, Target, load
from tests.mutants.suite import Suite
from tests.mutants.tree import Tree
from tests.mutants.verdict import Judge

ON = (Target.of("psa2"),)
# A wrong of the line, of the clock, of a register and of a service.
NAMES = ("frame-msb-first", "sync-a-3-tclk", "ads1282-fsc-reset", "sdo-toggle-unchecked")


def chosen() -> list[Mutant]:
    return [m for m in load() if m.id in NAMES]


def looked_at() -> tuple[str, ...]:
    """Requirements whose tests are run: the same for each, so that the unmutated emulator is checked once."""
    return tuple(i for m in chosen() for i in m.breaks)


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> Judge:
    folder = tmp_path_factory.mktemp("mutants") / "work"
    return Judge(Tree(folder, borrow=True), Suite(folder), quick=True)


@pytest.mark.parametrize("mutant", chosen(), ids=lambda m: m.id)
def test_is_found_by_the_requirement_that_it_breaks(judge: Judge, mutant: Mutant) -> None:
    before = (judge.tree.folder / mutant.file).read_bytes()
    r = judge.judge(replace(mutant, breaks=looked_at()))
    assert r.result == "killed", f"{r.result}: {r.reason}"
    assert r.failed
    assert set(mutant.breaks) & set(r.found), f"found by {r.found}"
    assert (judge.tree.folder / mutant.file).read_bytes() == before


def test_a_text_that_is_not_there_and_one_that_does_not_compile_are_told_as_such(judge: Judge) -> None:
    for old, new, what in (
        ("no such text", "", "bad list"),
        ("static bool port_free", "static bowl port_free", "does not"),
    ):
        m = Mutant(id="a", kind="value", file="emu/board/psa2/controller.c", old=old, new=new, on=ON)
        assert judge.judge(m).result.startswith(what)
