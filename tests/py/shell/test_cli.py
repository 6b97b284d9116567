"""The command line: each mistake gets one line (what, where, what would be right) and status 2, before any work."""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from command_line import mistake_line
from psabench import cli
from psabench import options as arguments
from psabench.link import lineport, log_file, record_command
from psabench.link.protocol_files import dbc_node
from psabench.procedures import compare_converters, gyro_params
from psabench.procedures.command_line import offered
from psabench.procedures.command_line import parser as run_command
from psabench.procedures.command_line.commands import COMMANDS
from psabench.procedures.registry import PROCEDURES

from tests.py.link.test_lineport import lines

MISTAKES: list[tuple[str, str]] = [
    (
        "run",
        "run: expected turns, fourier, reversal, all, compare-converters, sins-calibration, mems-gyro, "
        "sins-covariance, sins-snake, sins-calibration-secondary, koi-flight, koi-season, thermal, gyrocompass, "
        "heading-hold or script",
    ),
    ("run --out turns", "run: expected turns"),
    ("run spin", "run: expected turns, fourier, reversal, all, compare-converters, sins-calibration, "),
    ("run spin --positions 80", "heading-hold or script, got 'spin'"),
    ("run gyrocompas", "heading-hold or script, got 'gyrocompas' (did you mean gyrocompass?)"),
    ("rnu", "COMMAND: expected run, record, convert, "),
    ("rnu", "shell, got 'rnu' (did you mean run?)"),
    (
        "run turns --positions 80",
        "turns: expected an option that --help lists, got --positions (did you mean --condition?)",
    ),
    ("run --positions=80 turns", "turns: expected an option that --help lists, got --positions"),
    ("run turns fourier", "turns: expected no more arguments, got 'fourier'"),
    ("run gyrocompass --node 5", "gyrocompass: expected an option that --help lists, got --node"),
    ("run gyrocompass --hours 4", "gyrocompass: expected an option that --help lists, got --hours"),
    ("run sins-snake --flight loop", "--flight: expected snake, straight, or a file, got loop, no such file"),
    ("run sins-calibration-secondary", "--first: expected a recording"),
    (
        "run sins-calibration-secondary --seed 1 --latitude-deg 55 --longitude-deg 37 --plan nope",
        "--plan: expected article, two_rates",
    ),
    (
        "run sins-calibration-secondary --seed 1",
        "--latitude-deg, --longitude-deg: expected the table's place, got none",
    ),
    ("run sins-calibration-secondary --first x.csv --seed 1", "--first: expected a recording or a bench, got both"),
    ("run sins-calibration-secondary --first x.csv", "x.csv: expected outputs of a unit in CSV, got no such file"),
    ("campaign sins-secondary --pairs 0", "--pairs: expected 1 to 100000, got 0"),
    (
        "campaign sins-secondary --experiment x.yaml",
        "--experiment: expected article, or a file, got x.yaml, no such file",
    ),
    ("run heading-hold --average 16", "heading-hold: expected an option that --help lists, got --average"),
    (
        "run compare-converters --real-time",
        "compare-converters: expected --chamber, --scenario, --seed, --record, --replay, --out, --verbose, "
        "--json, got --real-time",
    ),
    ("run gyrocompass --window-s 0", "gyrocompass: window_s, repeat: expected at least 0.1 s and 1, got 0.0 s and 1"),
    (
        "run script nothing.psa --axis x",
        "script: expected --scenario, --pace, --control, --seed, --can, --scpi, --node, --json, got --axis",
    ),
    ("record run.log --speed 3", "record: expected --can, --lcm, --board, --node, --for, --count, --json, got --speed"),
    ("run all --axis w", "turns: axis: expected x, y or z, got 'w'"),
    ("run turns --out /dev/null/x", "/dev/null/x: "),
    ("run turns --truth x.sock", "--truth: expected --control of its emulator with it, got x.sock"),
    ("run turns --can socketcand:127.0.0.1:1", "--head: expected the VISA address of the dividing head"),
    ("decode nothing.log", "nothing.log: expected a CAN log, got no such file"),
    ("decode README.md", "README.md: expected an ending of .asc .blf"),
    ("decode --line nothing.bin", "nothing.bin: expected a capture of a line port, got no such file"),
    (
        "decode --line x.bin --board psd1 --out x.csv",
        "--line: expected a CAN log for this board (leave --line out), got psd1",
    ),
    ("decode --line nothing.bin --board psa1", "nothing.bin: expected a capture of a line port, got no such file"),
    ("decode --line /", "/: expected a capture of a line port, got a folder"),
    ("decode --line /dev/null --word-bits 17", "word_bits: expected 16, 24 or 32, got 17"),
    ("decode --line /dev/null --out /dev/null/x.csv", "/dev/null/x.csv: "),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_gets_one_line_and_status_2(
    line: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert words in mistake_line(line.split(), capsys)


def test_a_file_where_the_folder_of_a_report_should_be_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "sins-snake", "--out", "/dev/full"]) == 2
    assert capsys.readouterr().err == "psabench: /dev/full: expected a folder, got a file\n"


@pytest.mark.parametrize(
    ("convert", "text"),
    [
        (arguments.natural, "-3"),
        (arguments.natural, "x"),
        (arguments.positive, "0"),
        (arguments.positive, "nan"),
        (arguments.positive, "inf"),
        (arguments.node_id, "0"),
        (arguments.node_id, "128"),
        (arguments.yes_no, "maybe"),
        (arguments.board_name, "psd9"),
    ],
)
def test_an_argument_out_of_range_is_refused(convert: object, text: str) -> None:
    assert callable(convert)
    with pytest.raises(argparse.ArgumentTypeError, match="expected"):
        convert(text)


@pytest.mark.parametrize(("name", "board"), [("psa1", "psa2"), ("pik5", "pik"), ("pik6", "pik"), ("pmka", "pmka")])
def test_another_name_of_a_board_is_taken_as_the_board(
    name: str, board: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    node = dbc_node(board)
    Path("bus.log").write_text("".join(f"(0.{k}) can0 {k}8{node}#0000000000000000\n" for k in (1, 2, 3)))
    tables = []
    for known in (name, board):
        assert cli.main(["decode", "bus.log", "--board", known]) == 0
        tables.append(capsys.readouterr())
    assert tables[0] == tables[1]
    assert "frames 1" in tables[0].err


LOGS: list[tuple[str, str, str]] = [
    ("empty", "", "none; nodes with frames: none"),
    ("no samples", "(0.1) can0 705#00\n(0.2) can0 000#0100\n", "none; nodes with frames: none"),
    (
        "pair, FD frame, block and fast form of others",
        "(0.1) can0 187#15DA1F0100000000\n(0.2) can0 287#000000534C19E4B8\n(0.3) can0 201##100\n(0.4) can0 489##100\n"
        "(0.5) can0 3FF#0000000000000000\n",
        "none; nodes with frames: 1, 7, 9, 127",
    ),
    ("29-bit, remote", "(0.1) can0 00000187#00\n(0.2) can0 187#R\n", "none; nodes with frames: none"),
    ("half a pair", "(0.1) can0 185#15DA1F0100000000\n", "only parts of them; other nodes with frames: none"),
]


@pytest.mark.parametrize(("log", "words"), [x[1:] for x in LOGS], ids=[x[0] for x in LOGS])
def test_a_log_without_a_frame_of_the_node_gets_one_line_and_status_2(
    log: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bus.log").write_text(log)
    assert cli.main(["decode", "bus.log"]) == 2
    assert capsys.readouterr() == ("", f"psabench: bus.log: expected frames of node 5, got {words}\n")


def test_a_log_with_a_frame_of_the_node_is_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bus.log").write_text("(0.1) can0 187#15DA1F0100000000\n(0.2) can0 287#000000534C19E4B8\n")
    assert cli.main(["decode", "bus.log", "--node", "7"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("t_rx_s,")
    assert out.count("\n") == 2
    assert err == "frames 1, lost 0, torn 0\n"


def test_a_capture_without_a_frame_gets_one_line_and_status_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.bin").write_bytes(b"\x01\x00\x01")
    assert cli.main(["decode", "--line", "x.bin"]) == 2
    counts = "samples=3 frames=0 torn=1 lost=0 late=0 early=0 gaps=0"
    assert capsys.readouterr() == ("", f"psabench: x.bin: expected frames of 32-bit words, got none ({counts})\n")


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    samples = b"\x01" * 100 + lines([1, 2, 3, 4])
    command = [sys.executable, "-m", "psabench.cli", "decode", "--line", "/dev/stdin"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as p:
        assert p.stdin
        assert p.stdout
        assert p.stderr
        p.stdout.close()
        p.stdin.write(samples)
        p.stdin.close()
        words = p.stderr.read().decode()
        assert p.wait(60) == 0
    assert "Traceback" not in words
    assert "Failed pipe" not in words


def help_of(words: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", "160")
    with pytest.raises(SystemExit) as ended:
        cli.main([*words.split(), "--help"])
    assert ended.value.code == 0
    out, err = capsys.readouterr()
    assert err == ""
    return out


def test_a_fault_of_the_program_has_a_status_of_its_own(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Python's own status, 1, is that of a result out of limits."""

    def fail(_: argparse.Namespace) -> int:
        raise ZeroDivisionError("of a test")

    monkeypatch.setattr(cli, "parse", lambda _: argparse.Namespace(handler=fail))
    assert cli.main(["decode"]) == 70
    assert "ZeroDivisionError: of a test\npsabench: the lines above" in capsys.readouterr().err


def test_help_of_run_names_each_procedure_and_no_option_of_any(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = help_of("run", capsys, monkeypatch)
    for c in COMMANDS.values():
        assert re.search(rf"^  {c.name} +{re.escape(' '.join(c.summary.split()[:6]))}", told, re.MULTILINE)
    assert re.search(r"^  script +lines of the shell", told, re.MULTILINE)
    assert set(re.findall(r"^  .*?(--[a-z-]+)", told, re.MULTILINE)) == {"--help", "--list", "--json"}


@pytest.mark.parametrize("name", list(COMMANDS))
def test_help_of_a_procedure_is_of_its_own_options_with_unit_and_default(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    command = COMMANDS[name]
    told = help_of(f"run {name}", capsys, monkeypatch)
    shown = re.findall(r"^  (?:-v, )?(--[a-z0-9-]+)", told, re.MULTILINE)
    own = [f"--{f.replace('_', '-')}" for f in command.parameters.fields]
    assert shown == [*own, *command.own, *command.common]
    assert command.summary[1:] in told
    for option, f in zip(own, command.parameters.fields.values(), strict=True):
        text = " ".join(re.findall(rf"^  {option} .*\n(?:    +.*\n)*", told, re.MULTILINE)[0].split())
        shown_default = text.rpartition("(")[2].rstrip(")").partition(";")[0]
        value, _, unit = shown_default.partition(" ")
        assert unit == f.metadata["unit"]
        if f.default is None or isinstance(f.default, bool):
            assert value == ("none" if f.default is None else "yes" if f.default else "no")
        else:
            assert type(f.default)(value) == f.default


def test_defaults_of_another_reading_and_of_another_procedure_are_told(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = help_of("run gyrocompass", capsys, monkeypatch)
    assert "(0,90,180 deg; improved 0,180,90,270)" in told
    assert "(2 1/s)" in told  # m2 is the same in both
    assert "readings at each position (1; turns 16)" in help_of("run all", capsys, monkeypatch)


@pytest.mark.parametrize("name", [*COMMANDS, "script"])
def test_every_example_of_a_help_is_understood(
    name: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = help_of(f"run {name}", capsys, monkeypatch)
    examples = re.findall(r"^  psabench (run .*?)(?:   .*)?$", told.partition("examples:")[2], re.MULTILINE)
    assert examples
    for example in examples:
        args = cli.parse(shlex.split(example))
        assert callable(args.handler)


WORDS: list[tuple[str, str, str]] = [
    ("turns --seed 3", "turns", "--seed 3"),
    ("--seed 3 turns --axis y", "turns", "--seed 3 --axis y"),
    ("--seed=3 turns", "turns", "--seed=3"),
    ("--real-time turns", "turns", "--real-time"),
    ("--real- turns", "turns", "--real-"),
    ("-v turns", "turns", "-v"),
    ("--out turns turns", "turns", "--out turns"),
    ("--latitude-deg -50 gyrocompass", "gyrocompass", "--latitude-deg -50"),
    ("turns --list", "", "--list"),
    ("--list", "", "--list"),
    ("-h turns", "turns", "-h"),
    ("--help", "", "--help"),
    ("--seed 3", "", ""),
    ("spin --seed 3", "", "spin"),
    ("script a.psa --json", "script", "a.psa --json"),
    ("", "", ""),
]


@pytest.mark.parametrize(("typed", "name", "rest"), WORDS, ids=[w[0] for w in WORDS])
def test_the_procedure_may_stand_anywhere_among_its_options(typed: str, name: str, rest: str) -> None:
    assert run_command.words(typed.split()) == (name, rest.split())


def test_list_names_every_procedure_with_its_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "--list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines[::2]] == list(COMMANDS)
    for line, c in zip(lines[1::2], COMMANDS.values(), strict=True):
        assert line.split() == [*(f"--{f.replace('_', '-')}" for f in c.parameters.fields), *c.common]


def test_list_as_json_has_the_same(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert cli.main(["run", "--list", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [c["name"] for c in found] == list(COMMANDS)
    turns = COMMANDS["turns"].parameters.fields
    assert {p["option"]: p["default"] for p in found[0]["parameters"]} == {
        f"--{name.replace('_', '-')}": f.default for name, f in turns.items()
    }
    for command in found:
        offered = help_of(f"run {command['name']}", capsys, monkeypatch)
        named = {p["option"] for p in command["parameters"]} | set(command["options"])
        assert set(re.findall(r"^  (?:-v, )?(--[a-z0-9-]+)", offered, re.MULTILINE)) == named


def test_requirements_as_json_are_those_of_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["conform", "list", "--board", "pik"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert cli.main(["conform", "list", "--board", "pik", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [f"{r['id']:16} {r['grade']} {'/'.join(r['observe']) or '-':16} {r['text']}" for r in found] == lines


def test_without_a_command_help_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "examples:" in err


# Libraries that take 0.1 s or more to load, and the modules of the package that load them.
HEAVY = {
    "numpy",
    "scipy",
    "matplotlib",
    "can",
    "canopen",
    "cantools",
    "yaml",
    "serial",
    "pyvisa",
    "prompt_toolkit",
    "IPython",
    "dask",
    "distributed",
    "asammdf",
}
LIGHT: list[tuple[str, set[str]]] = [  # a command line, and what reading it may load of HEAVY
    ("--version", set()),
    ("--help", set()),
    ("run --help", set()),
    ("run spin", set()),
    ("run turns --axis y", {"numpy"}),
    ("run gyrocompass --seed 3", {"numpy"}),
    ("run script x.psa", set()),
    ("record run.log --board pmka --for 3", set()),
    ("decode run.log --out run.csv", set()),
    ("convert run.log run.mcap", set()),
    ("view --port 0", set()),
    ("waveform run.vcd --wavedrom run.json", set()),
    ("tap slcan port run.pcap", set()),
    ("campaign gyrocompass --runs 3", {"numpy"}),
    ("campaign --help", set()),
    ("campaign quartz-deformation --elements 3", set()),
    ("campaign run-in --units 3", set()),
    ("campaign heading-modes --runs 3", {"numpy"}),
    ("campaign sins-methods --units 3", set()),
    ("campaign sins-plan --plans 3", set()),
    ("report diff build/a build/b", set()),
    ("conform --help", set()),
    ("conform device --board psa2", set()),
    ("conform recording run.log --board psa2", set()),
    ("conform host --manual can", set()),
    ("conform list --board psa2", set()),
    ("shell quiet", set()),
]


@pytest.mark.parametrize(("line", "allowed"), LIGHT, ids=[x[0] for x in LIGHT])
def test_a_command_line_is_read_without_libraries_and_other_commands(line: str, allowed: set[str]) -> None:
    program = f"""if True:
        import contextlib, io, sys
        import psabench.cli
        with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
            psabench.cli.parse({line.split()!r})
        print(*sys.modules)
    """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    loaded = done.stdout.split()
    assert "psabench.cli" in loaded
    assert HEAVY & set(loaded) <= allowed
    commands = {
        "psabench.link.record",
        "psabench.boards.decode",
        "psabench.bench",
        "psabench.report.calibration",
        "psabench.conform.runner",
    }
    assert not commands & set(loaded)


def test_heavy_libraries_are_loaded_when_a_command_needs_them() -> None:
    """That names of HEAVY are still those of libraries in use: the test above could not fail otherwise."""
    program = """if True:
        import sys
        from psabench.procedures import run  # noqa
        from psabench.report import plots  # noqa
        from psabench.conform import requirements
        from psabench.link.protocol_files import database
        from psabench.shell import terminal
        database()
        print(*sys.modules)
    """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    expected = {"numpy", "matplotlib", "can", "canopen", "cantools", "yaml", "prompt_toolkit"}
    assert HEAVY & set(done.stdout.split()) >= expected


def test_help_names_every_command_with_its_help_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    told = help_of("", capsys, monkeypatch)
    for name, (_, line) in cli.COMMANDS.items():
        assert re.search(rf"^    {name} +{re.escape(line)}$", told, re.MULTILINE)
        assert help_of(name, capsys, monkeypatch).startswith(f"usage: psabench {name} ")


def test_what_the_options_repeat_is_what_the_libraries_have() -> None:
    assert arguments.LINE_HZ == lineport.SAMPLE_HZ
    shown = re.findall(r"\.[a-z0-9]+", record_command.FORMATS)
    assert set(shown) | {".mf4"} == {*log_file.FORMATS, ".mf4"}  # .mf4 with asammdf
    assert list(offered.ON_THE_HEAD) == list(PROCEDURES)
    assert list(offered.ON_THE_PLATFORM) == list(gyro_params.PARAMS)
    assert offered.COMPARE[0] == compare_converters.NAME


def test_help_has_no_colours_whatever_python_offers() -> None:
    """argparse of Python 3.14 looks at this attribute."""
    assert vars(cli.parser())["color"] is False
    assert vars(run_command._parser_of(COMMANDS["turns"]))["color"] is False


@pytest.mark.parametrize(
    ("line", "kept"),
    [
        ("run turns", "; what was measured is kept"),
        ("run all", "; what was measured is kept"),
        ("run thermal", "; what was measured is kept; --resume continues the run"),
        ("campaign gyrocompass", "; what was measured is kept"),
        ("campaign run-in", "; what was measured is kept"),
        ("campaign quartz-deformation", ""),
        ("record run.log", "; what was recorded is kept"),
        ("run gyrocompass", ""),
        ("run compare-converters", ""),
        ("view", ""),
        ("convert run.log run.blf", ""),
        ("decode run.log", ""),
    ],
)
def test_ctrl_c_says_what_is_kept(
    line: str, kept: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def pressed(_: argparse.Namespace) -> int:
        raise KeyboardInterrupt

    args = cli.parse(line.split())
    args.handler = pressed
    monkeypatch.setattr(cli, "parse", lambda words: args)
    assert cli.main(line.split()) == 130
    assert capsys.readouterr().err == f"psabench: interrupted{kept}\n"


@pytest.mark.parametrize(("own", "kept"), [(None, "1"), ("2", "2")], ids=["as-is", "own-setting"])
def test_a_command_computes_in_one_thread(own: str | None, kept: str) -> None:
    """Set before numpy is loaded, which looks once; who wants more threads says so."""
    program = (
        "import os, sys\nfrom psabench.cli import main\nmain(['report', 'diff', '/nothing/a', '/nothing/b'])\n"
        "assert 'numpy' not in sys.modules\nimport numpy\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'], len(os.listdir('/proc/self/task')))"
    )
    env = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
    env |= {"OPENBLAS_NUM_THREADS": own} if own else {}
    done = subprocess.run(
        [sys.executable, "-c", program], env=env, stdout=subprocess.PIPE, text=True, check=True, timeout=60
    )
    setting, threads = done.stdout.split()
    assert setting == kept
    assert own or threads == "1"
