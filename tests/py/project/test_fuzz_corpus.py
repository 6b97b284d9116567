"""tools/fuzz_corpus.py: a target's inputs in one text file, and out of it again, byte for byte."""

from __future__ import annotations

import hashlib
from pathlib import Path

import fuzz_corpus
import pytest

INPUTS = {"empty": b"", "all_bytes": bytes(range(256)), "late.read-2": b"\n 00 \n"}


@pytest.fixture
def corpus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An archive of its own for the target t."""
    monkeypatch.setattr(fuzz_corpus, "CORPUS", tmp_path)
    fuzz_corpus.write(tmp_path / "fuzz_t.txt", INPUTS)
    return tmp_path / "fuzz_t.txt"


def test_inputs_come_out_as_they_went_in(corpus: Path, tmp_path: Path) -> None:
    text = corpus.read_text()
    assert [line.split(" ")[0] for line in text.splitlines()] == sorted(INPUTS)
    out = tmp_path / "out"
    (out / "fuzz_t").mkdir(parents=True)
    (out / "fuzz_t/stale").touch()
    assert fuzz_corpus.main(["unpack", str(out), "t", "fuzz_none"]) == 0
    assert {p.name: p.read_bytes() for p in (out / "fuzz_t").iterdir()} == INPUTS
    assert list((out / "fuzz_none").iterdir()) == []
    corpus.unlink()
    assert fuzz_corpus.main(["pack", str(out), "fuzz_t"]) == 0
    assert corpus.read_text() == text


def test_an_input_is_added_once_under_its_digest_or_a_name(
    corpus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new, known = tmp_path / "new", tmp_path / "known"
    new.write_bytes(b"new")
    known.write_bytes(INPUTS["all_bytes"])
    assert fuzz_corpus.main(["add", "t", str(new), str(known)]) == 0
    assert capsys.readouterr().out == "fuzz_t.txt: 1 added\n"
    assert fuzz_corpus.read(corpus) == INPUTS | {hashlib.sha1(b"new").hexdigest(): b"new"}
    new.write_bytes(b"other")
    assert fuzz_corpus.main(["add", "t", str(new), "--name", "empty"]) == 2
    assert fuzz_corpus.main(["add", "t", str(new), "--name", "by_hand"]) == 0
    assert fuzz_corpus.read(corpus)["by_hand"] == b"other"


@pytest.mark.parametrize("line", ["a 0g", "a 000", "a/b 00", " 00", "empty 00"])
def test_a_line_that_is_no_input_is_an_error(line: str, corpus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    corpus.write_text(f"empty\n{line}\n")
    assert fuzz_corpus.main(["unpack", str(corpus.parent / "out"), "t"]) == 2
    assert f"{corpus}:2: expected a new name and hexadecimal bytes, got {line!r}" in capsys.readouterr().err


@pytest.mark.parametrize("path", sorted(fuzz_corpus.CORPUS.glob("*")), ids=lambda p: p.name)
def test_the_tracked_corpus(path: Path) -> None:
    """A target for each file, and lines as the tool writes them."""
    assert len(list(fuzz_corpus.CORPUS.parent.rglob(f"{path.stem}.c"))) == 1
    inputs = fuzz_corpus.read(path)
    assert inputs
    assert path.read_text().splitlines() == [f"{n} {inputs[n].hex()}".rstrip() for n in sorted(inputs)]
