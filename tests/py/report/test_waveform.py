"""Reading a VCD, cutting it, and drawing it: whatever is missing or broken gets one line."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from psabench.link.vcd import parse_vcd, read_vcd, scale_name
from psabench.report import drawing, waveform

HEAD = "$timescale 10 ns $end\n$scope module psa2 $end\n"
FILE = (
    HEAD
    + "$var wire 1 ! Int $end\n$var wire 1 # CLK $end\n$upscope $end\n$enddefinitions $end\n"
    + "#5\n$dumpvars\n1!\n0#\n$end\n#10\n0!\n#20\n1#\n#25\n0#\n1!\n#30\n"
)


def test_a_recording_is_levels_over_time() -> None:
    v = parse_vcd(FILE)
    assert (v.unit_ns, v.start_ns, v.end_ns) == (10, 50, 300)
    assert list(v.wires) == ["Int", "CLK"]
    assert v.wires["Int"].t_ns.tolist() == [50, 100, 250]
    assert v.wires["Int"].edges_ns(0).tolist() == [100]
    assert [int(v.wires["Int"].at(t)) for t in (0, 99, 100, 249, 250, 999)] == [1, 1, 0, 0, 1, 1]
    assert v.edges(["CLK", "Int"], 100, 250) == [(200, "CLK", 1), (250, "CLK", 0), (250, "Int", 1)]


def test_codes_of_wires_may_be_long_and_words_apart_by_any_blank() -> None:
    long = FILE.replace("var wire 1 #", "var wire 1 CLOCKS&!").replace("0#", "0CLOCKS&!").replace("1#", "1CLOCKS&!")
    v, w = parse_vcd(long.replace("\n", "\r\n\t ")), parse_vcd(FILE)
    assert [x.t_ns.tolist() for x in v.wires.values()] == [x.t_ns.tolist() for x in w.wires.values()]
    assert [x.level.tolist() for x in v.wires.values()] == [x.level.tolist() for x in w.wires.values()]


def test_a_wire_without_a_level_is_none() -> None:
    assert list(parse_vcd(FILE.replace("$upscope", "$var wire 1 % Data $end\n$upscope")).wires) == ["Int", "CLK"]
    empty = parse_vcd(FILE.partition("#5")[0])
    assert (empty.start_ns, empty.end_ns, empty.wires) == (-10, -10, {})


def test_a_window_is_a_recording_that_sigrok_reads_to_its_last_edge() -> None:
    text = parse_vcd(FILE).window(["CLK", "Int"], 150, 250)
    assert text == (
        "$version psabench $end\n$timescale 10 ns $end\n$scope module psa2 $end\n"
        '$var wire 1 ! CLK $end\n$var wire 1 " Int $end\n$upscope $end\n$enddefinitions $end\n'
        '#15\n$dumpvars\n0!\n0"\n$end\n#20\n1!\n#25\n0!\n1"\n#26\n'
    )
    assert parse_vcd(text).window(["CLK", "Int"], 150, 250) == text


@pytest.mark.parametrize(("ns", "name"), [(1, "1 ns"), (10, "10 ns"), (100_000, "100 us"), (1_000_000_000, "1 s")])
def test_units_have_names(ns: int, name: str) -> None:
    assert scale_name(ns) == name


def test_a_unit_that_vcd_does_not_know_is_refused() -> None:
    with pytest.raises(ValueError, match=r"VCD time unit: expected .*, got 25 ns"):
        scale_name(25)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "x.vcd: expected a VCD file"),
        (FILE.replace("10 ns", "10 fs"), "x.vcd: expected .timescale of 1 ns to 100 s, got 10 fs"),
        (FILE.replace("10 ns", "10 years"), "x.vcd: expected .timescale"),
        (FILE.partition("$enddef")[0], "no .enddefinitions"),
        (
            FILE.replace("#20\n1#", "#20\nx#"),
            "x.vcd: after #20: expected a time or a level of a declared wire, got 'x#'",
        ),
        (FILE.replace("#20\n1#", "#20\n1?"), "after #20: expected .*, got '1.'"),
        (FILE.replace("#20\n", "#2a0\n"), "x.vcd: after #10: expected .*, got '#2a0'"),
        (FILE.replace("#20\n", "#\n"), "x.vcd: after #10: expected .*, got '#'"),
        (FILE.replace("#20\n", "#9999999999999999999\n"), "after #10: expected .*, got '#9999999999999999999'"),
        (FILE.replace("#25\n0#", "#25\n0##"), "x.vcd: after #25: expected .*, got '0##'"),
        (FILE.replace("#25\n0#", "#25\nx#\n#y"), "x.vcd: after #25: expected .*, got 'x#'"),
        (FILE.replace("#25\n0#", "#15\n0#"), "x.vcd: after #20: expected a time after the one before it, got '#15'"),
    ],
)
def test_a_damaged_recording_is_rejected_with_its_place(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        parse_vcd(text, "x.vcd")


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        ([], "usage"),
        (["a.vcd", "circle", "b.svg"], "usage"),
        (["nothere.vcd", "frame", "b.svg"], "nothere.vcd: expected a VCD file, got no such file"),
        (["two.vcd", "setup", "b.svg"], "expected the lines CST, DIn, DInT"),
        (["two.vcd", "frame", "b.svg"], "expected the lines Data, got Int, CLK"),
        (["still.vcd", "frame", "b.svg"], "expected a whole frame"),
        (["two.vcd", "cycle", "b.svg"], "expected the lines A0, CLK_1M25, CS, DR"),
        (["cut.vcd", "handover", "b.svg"], "FL2: expected a whole cycle: a change to 1"),
    ],
)
def test_the_command_says_what_is_missing(
    argv: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("two.vcd").write_text(FILE)
    Path("still.vcd").write_text(
        FILE.replace("$upscope", "$var wire 1 d Data $end\n$upscope").replace("1!\n0#\n", "1!\n0#\n0d\n")
    )
    names = "CLK_1M25 DR A0 RFX RFY RFZ SCLK SDAT FL2 CS".split()
    wires = "".join(f"$var wire 1 {chr(97 + i)} {name} $end\n" for i, name in enumerate(names))
    levels = "".join(f"0{chr(97 + i)}\n" for i in range(len(names)))
    Path("cut.vcd").write_text(f"{HEAD}{wires}$upscope $end\n$enddefinitions $end\n#5\n{levels}#9\n1c\n#30\n")
    assert waveform.main(argv) == 2
    assert says in capsys.readouterr().err
    assert not Path("b.svg").exists()


def test_the_command_draws(tmp_path: Path) -> None:
    golden = Path(__file__).resolve().parents[2] / "golden"
    out = tmp_path / "frame.svg"
    assert waveform.main([str(golden / "first_frames.vcd"), "frame", str(out)]) == 0
    assert out.read_text(encoding="utf-8") == waveform.frame_picture(read_vcd(golden / "first_frames.vcd"))


def test_an_interval_is_drawn_with_its_length() -> None:
    dims = (drawing.Dim("Int", 100, "CLK", 200, ", at most 110", 0), drawing.Dim("Int", 100, "Int", 1_250, "", 1))
    panel = drawing.Panel(("Int", "CLK"), (drawing.Section(50, 1_300, 100),), dims=dims)
    svg = drawing.render(parse_vcd(FILE), [panel], "")
    assert ">100 ns, at most 110<" in svg
    assert ">1 150 ns<" in svg
    assert svg.count('class="guide"') == 4


def test_sections_cut_waves_at_their_ends() -> None:
    section = drawing.Section(100, 200, 100)
    svg = drawing.render(parse_vcd(FILE), [drawing.Panel(("Int", "CLK"), (section,))], "a & b")
    assert "<title>a &amp; b</title>" in svg
    assert svg.count('class="wave"') == 2
    assert "V" not in svg.split('class="wave" d="')[1].split('"')[0]  # Int does not change inside


@pytest.mark.parametrize("end_ns", range(7_000, 8_200, 100))
def test_the_names_of_instants_are_inside_the_picture(end_ns: int) -> None:
    section = drawing.Section(0, end_ns, -22_000)
    svg = drawing.render(parse_vcd(FILE), [drawing.Panel(("Int", "CLK"), (section,))], "")
    names = re.findall(r'<text class="note" x="([\d.]+)" y="[\d.]+">([^<]+)<', svg)
    assert len(names) > 5
    assert all(float(x) + drawing.CHARACTER * len(name) < drawing.WIDTH for x, name in names), names
