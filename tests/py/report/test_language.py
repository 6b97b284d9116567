"""Reports in Russian: every text of a calibration, the same numbers, a catalogue without slips."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import polib
import pytest
from command_line import mistake_line
from psabench.errors import BadInput
from psabench.report import calibration, language
from psabench.report.language import Language, key_of, keys_of, load_language, localised_page, reports_in, take_option
from psabench.report.nominal import ARTICLE
from report_sections import TRUTH, sections

CATALOGUE = [e for path in sorted((language.LOCALE / "ru").glob("*.po")) for e in polib.pofile(str(path))]
NUMBER = re.compile(r"\d+(?:\.\d+)?")


def russian() -> Language:
    found = load_language("ru")
    assert found is not None
    return found


def bare_numbers(page: str) -> Counter[str]:
    """Those of the texts: a picture's geometry is in attributes."""
    return Counter(NUMBER.findall(re.sub(r"<style.*?</style>|<[^>]*>|&[^;]*;", " ", page, flags=re.DOTALL)))


FACTS = {"seed": "7", "procedure": "reversal", "bench": "rack, x", "scenario": "quiet, x"}


@pytest.mark.parametrize("truth", [TRUTH, None])
def test_a_calibration_is_russian_throughout_with_the_same_numbers(truth: dict[str, float] | None) -> None:
    page = calibration.html_page(sections(truth), FACTS, ARTICLE)
    ru = russian()
    translated = ru.translate_page(page)
    assert ru.missing == set()
    assert "<html lang=ru>" in translated
    assert "Калибровка акселерометра" in translated
    assert "процедура <b>реверс</b>" in translated
    assert "стенд <b>rack, x</b>" in translated  # a name that is not known stays whole
    assert "сценарий <b>идеальный, x</b>" in translated
    assert bare_numbers(translated) == bare_numbers(page)
    assert Counter(re.findall(r"<\w+", translated)) == Counter(re.findall(r"<\w+", page))


def test_what_the_catalogue_lacks_stays_english_and_is_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = "<html lang=en><p>error</p><p>a text of 3 words</p><footer><p>error</p></footer>"
    with reports_in("ru"):
        assert localised_page(page) == (
            "<html lang=ru><p>погрешность</p><p>a text of 3 words</p><footer><p>error</p></footer>"
        )
    assert capsys.readouterr().err == "psabench: --lang ru: 1 of 2 texts are English\n"
    assert localised_page(page) == page


def test_numbers_may_change_places() -> None:
    ru = Language(name="ru", texts={"{} of {}": "из {1} — {0}"})
    assert ru.translate_page("<td>3 of -4.5e-06</td>") == "<td>из -4.5e-06 — 3</td>"


def test_indices_and_names_are_no_numbers() -> None:
    assert key_of(" k2 of PSA-2 in 1.5 s, v0.3 ") == "k2 of PSA-2 in {} s, v0.3"


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("5 words of Data", ("{} words of Data", "{} words of {}", "{} words of {}")),
        ("01h, 0Ah on DOutX at 2 V", ("{}, {} on DOutX at {} V", "{}, {} on {} at {} V", "{} on {} at {} V")),
        ("[1, 2] as PHASE tells", ("[{}, {}] as PHASE tells", "{} as {} tells", "{} as {} tells")),
        ("41 00 5A, then the board's own", ("{} {} {}A, then the board's own", *("{}, then the board's own",) * 2)),
        ("E no-address of 3 mV rms", ("E no-address of {} mV rms", *("{} of {} mV rms",) * 2)),
    ],
)
def test_names_and_lists_are_blanks_of_an_entry_too(text: str, keys: tuple[str, str, str]) -> None:
    assert keys_of(text) == keys


def test_the_closest_entry_is_taken() -> None:
    ru = Language(
        name="ru", texts={"{} on {}": "{1}: {0}", "{} on CLK": "на CLK {}", "of {}": "из {}", "{} told": "{} дано"}
    )
    assert ru.translate_page("<td>3 on CLK</td>") == "<td>на CLK 3</td>"
    assert ru.translate_page("<td>FFh on Data</td>") == "<td>Data: FFh</td>"
    assert ru.translate_page("<td>of X, Y</td><td>[1, 2] told</td>") == "<td>из X, Y</td><td>[1, 2] дано</td>"
    assert ru.missing == set()


def test_a_blank_holds_a_text_of_the_catalogue_and_the_other_words_stay_missing() -> None:
    texts = {"no state {} {}": "нет состояния {} {}", "after a stop": "после остановки", "lost {}": "потеряно {}"}
    ru = Language(name="ru", texts=texts | {"{} of them": "из них {}"})
    assert ru.translate_page("<td>no state 04h after a stop</td>") == "<td>нет состояния 04h после остановки</td>"
    assert ru.translate_page("<td>lost 3 of them, 5 of them</td>") == "<td>потеряно из них 3, из них 5</td>"
    assert ru.missing == set()
    ru.translate_page("<td>no state 04h after a start</td>")
    assert ru.missing == {"no state {} after a start"}


def test_braces_of_a_text_are_no_blanks() -> None:
    ru = Language(name="ru", texts={'{"gone": true} once': '{"gone": true} один раз'})
    assert ru.translate_page('<td>{"gone": true} once</td>') == '<td>{"gone": true} один раз</td>'


def test_a_long_list_with_an_unknown_end_is_given_up_at_once() -> None:
    """Each of its parts fits by itself, so that without a memory of them all rows of parts would be tried."""
    text = "a part, " * 24 + "an end"
    ru = Language(name="ru", texts={"a part": "часть", "a part, a part": "две части"})
    assert ru.translate_page(f"<td>{text}</td>") == f"<td>{text}</td>"
    assert ru.missing == {text}


def test_quotes_of_a_source_and_words_of_a_program_stay_and_tooltips_are_translated() -> None:
    texts = {"a rule": "правило", "no frame": "нет кадра", "said": "сообщение:", "a tip": "пояснение"}
    ru = Language(name="ru", texts=texts)
    assert ru.translate_page("<td>a rule<p class=orig lang=en>As it is.</p></td>") == (
        "<td>правило<p class=orig lang=en>As it is.</p></td>"
    )
    assert ru.translate_page("<td>no frame; said no such bus, sorry</td>") == (
        "<td>нет кадра; сообщение: <span lang=en>no such bus, sorry</span></td>"
    )
    assert ru.translate_page("<th title='a tip'>k</th>") == "<th title='пояснение'>k</th>"
    assert ru.missing == set()
    ru.translate_page("<th title='another tip'>k</th>")
    assert ru.missing == {"another tip"}


def test_an_entry_has_the_numbers_and_the_markup_of_its_text() -> None:
    tag = re.compile(r"<[^>]*>")
    for entry in CATALOGUE:
        places = re.findall(r"\{\d*\}", entry.msgstr)
        assert len(places) == entry.msgid.count("{}"), entry.msgid
        assert len(set(places)) == (len(places) if re.search(r"\{\d", entry.msgstr) else min(len(places), 1)), (
            entry.msgid
        )
        assert sorted(tag.findall(entry.msgstr)) == sorted(tag.findall(entry.msgid)), entry.msgid
        assert entry.msgid in keys_of(entry.msgid)


def test_no_entry_is_there_twice() -> None:
    assert [k for k, n in Counter(e.msgid for e in CATALOGUE).items() if n > 1] == []


@pytest.mark.parametrize(
    ("words", "left", "name"),
    [
        (["run", "turns", "--lang", "ru", "-v"], ["run", "turns", "-v"], "ru"),
        (["--lang=ru", "run", "turns"], ["run", "turns"], "ru"),
        (["run", "turns"], ["run", "turns"], "en"),
        (["--lang", "en", "run", "--lang=ru"], ["run"], "ru"),
    ],
)
def test_the_option_stands_anywhere(words: list[str], left: list[str], name: str) -> None:
    assert take_option(words) == (left, name)


def test_mistakes_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(BadInput, match="--lang: expected a value, got none"):
        take_option(["run", "--lang"])
    assert mistake_line(["run", "turns", "--lang", "xx"], capsys).endswith("--lang: expected en, ru, got 'xx'\n")
    assert mistake_line(["--lang", "ru"], capsys).endswith("psabench: expected a command, got none\n")
