"""A few mutants of `make mutants`, built and judged: the suite's teeth are looked at in every run of the tests."""

from __future__ import annotations

import pytest
from mutants.declared import Mutant, Target, load
from mutants.judge import Judge
from mutants.suite import Suite
from mutants.tree import Tree

ON = (Target.of("psa2"),)  # one board, so that the unmutated emulator is judged once
# A wrong of the line, of the clock, of a register and of a service: five seconds of the machine each.
NAMES = ("frame-msb-first", "sync-a-3-tclk", "ads1282-fsc-reset", "sdo-toggle-unchecked")


def chosen() -> list[Mutant]:
    return [m for m in load() if m.id in NAMES]


@pytest.fixture(scope="module")
def judge(tmp_path_factory: pytest.TempPathFactory) -> Judge:
    folder = tmp_path_factory.mktemp("mutants") / "work"
    judge = Judge(Tree(folder, borrow=True), Suite(folder))
    judge.baseline(ON)
    return judge


@pytest.mark.parametrize("mutant", chosen(), ids=lambda m: m.id)
def test_is_found_by_the_requirement_that_it_breaks(judge: Judge, mutant: Mutant) -> None:
    before = (judge.tree.folder / mutant.file).read_bytes()
    r = judge.judge(mutant)
    assert (r.result, r.named) == ("killed", True), f"{r.result}: {r.found} {r.reason}"
    assert (judge.tree.folder / mutant.file).read_bytes() == before


def test_a_text_that_is_not_there_and_one_that_does_not_compile_are_told_as_such(judge: Judge) -> None:
    for old, new, what in (
        ("no such text", "", "bad list"),
        ("static bool port_free", "static bowl port_free", "does not"),
    ):
        m = Mutant(id="a", kind="value", file="emu/board/psa2.c", old=old, new=new, on=ON)
        assert judge.judge(m).result.startswith(what)
