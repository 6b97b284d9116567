"""What ties tests to requirements: ids registered by a decorator, and the same read off the source."""

from __future__ import annotations

from collections.abc import Iterator

import find_tests
import pytest
from psabench.conform import proves as proof


@pytest.fixture
def registry() -> Iterator[None]:
    """Proofs that a test registers are forgotten after it."""
    before = list(proof._suite_tests)
    yield
    proof._suite_tests[:] = before


@pytest.mark.usefixtures("registry")
def test_a_test_is_registered_under_its_ids() -> None:
    @proof.proves("PSA2-FRAME-01", "PSA2-FRAME-02")
    def four_words() -> str:
        return "4 words"

    assert proof.suite_tests()[-1] == proof.SuiteTest(four_words, ("PSA2-FRAME-01", "PSA2-FRAME-02"))
    assert four_words() == "4 words"


@pytest.mark.usefixtures("registry")
@pytest.mark.parametrize(
    ("ids", "says"),
    [
        ((), "expected ids"),
        (("PSA2-FRAME-01",) * 2, "each once"),
        (("PSA2-FRAME-99",), "expected ids of requirements, got PSA2-FRAME-99"),
    ],
)
def test_a_test_of_nothing_known_is_refused(ids: tuple[str, ...], says: str) -> None:
    before = proof.suite_tests()
    with pytest.raises(ValueError, match=says):
        proof.proves(*ids)
    assert proof.suite_tests() == before


SUITE = """
from psabench.conform import proof
from psabench.conform.proves import proves

@proves("PSA2-FRAME-01")
def one(): ...

class Group:
    @proof.proves("PSA2-FRAME-02", "PSA2-FRAME-03")
    def two(self): ...

@check("stream", "PSA2-FRAME-06", needs={"can"})
def three(e, row): ...

@active("PSA2-FRAME-07", "PSA2-FRAME-08", needs={"can"})
def four(s): ...

@check("stream")
@other("PSA2-FRAME-04")
def none(): ...
TEXT = '''@proves("PSA2-FRAME-05")'''
"""


def test_proofs_are_read_off_the_source() -> None:
    assert list(find_tests.proved_in_python(SUITE)) == [
        ("one", ("PSA2-FRAME-01",)),
        ("three", ("PSA2-FRAME-06",)),
        ("four", ("PSA2-FRAME-07", "PSA2-FRAME-08")),
        ("two", ("PSA2-FRAME-02", "PSA2-FRAME-03")),
    ]


@pytest.mark.parametrize("mark", ["@check('stream', ID)", "@active(*IDS, needs={'can'})"])
def test_an_id_beside_a_plan_is_literal_too(mark: str) -> None:
    with pytest.raises(ValueError, match="of f wants literal ids"):
        list(find_tests.proved_in_python(f"{mark}\ndef f(): ..."))


@pytest.mark.parametrize("mark", ["@proves(ID)", "@proves(*IDS)", "@proves('A', ids=1)", "@proves(f'PSA2-{n}')"])
def test_an_id_that_is_no_literal_is_refused(mark: str) -> None:
    with pytest.raises(ValueError, match="line 1: @proves of f wants literal ids"):
        list(find_tests.proved_in_python(f"{mark}\ndef f(): ..."))
