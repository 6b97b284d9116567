#!/usr/bin/env python3
"""MAVLink headers and Python module of proto/mavlink/psabench.xml, made by pymavlink's generator.

Usage: gen_mavlink.py --out DIR. Writes into DIR/mavlink: `psabench/mavlink.h` and what it includes,
`psabench_mavlink.py`, and `xml/` with the dialect and the standard messages that it includes, for tools that read XML.
A file that does not change is left alone, so that nothing is compiled again for nothing.
"""

import argparse
import contextlib
import io
import shutil
import sys
import tempfile
from pathlib import Path

import pymavlink.dialects.v20
from pymavlink.generator import mavgen, mavparse

ROOT = Path(__file__).resolve().parents[1]
DIALECT = ROOT / "proto/mavlink/psabench.xml"
STANDARD = ("common", "standard", "minimal")  # as psabench.xml includes them, one another
MODULE = "psabench_mavlink.py"


def generate(language: str, output: Path, xml: Path) -> None:
    """One run of mavgen; its report of progress is dropped. Raises RuntimeError with the report when it fails."""
    options = mavgen.Opts(
        str(output), wire_protocol=mavparse.PROTOCOL_2_0, language=language, validate=False, strict_units=False
    )
    report = io.StringIO()
    with contextlib.redirect_stdout(report), contextlib.redirect_stderr(report):
        done = mavgen.mavgen(options, [str(xml)])
    if done is False:
        raise RuntimeError(f"{xml.name}: mavgen --lang {language}: {report.getvalue()}")


def undated(path: Path) -> bytes:
    """The text of a generated file without what differs from run to run."""
    if path.name != "version.h":
        return path.read_bytes()
    lines = path.read_text().splitlines(keepends=True)
    return "".join(line for line in lines if "MAVLINK_BUILD_DATE" not in line).encode()


def update(made: Path, out: Path) -> None:
    """Bring `out` to the state of `made`."""
    new = {p.relative_to(made): undated(p) for p in sorted(made.rglob("*")) if p.is_file()}
    old = {p.relative_to(out) for p in out.rglob("*") if p.is_file() and "__pycache__" not in p.parts}
    for gone in old - new.keys():
        (out / gone).unlink()
    for name, data in new.items():
        path = out / name
        if not path.exists() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)


def main(argv: list[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="write DIR/mavlink")
    args = parser.parse_args(argv)
    dialects = Path(pymavlink.dialects.v20.__file__).parent
    with tempfile.TemporaryDirectory(prefix="psabench-mavlink-") as name:
        made = Path(name) / "mavlink"
        (made / "xml").mkdir(parents=True)
        for standard in STANDARD:
            shutil.copyfile(dialects / f"{standard}.xml", made / "xml" / f"{standard}.xml")
        xml = made / "xml" / DIALECT.name
        shutil.copyfile(DIALECT, xml)
        generate("C", made, xml)
        generate("Python3", made / MODULE, xml)
        for test in made.rglob("testsuite.h"):
            test.unlink()
        update(made, args.out / "mavlink")
    return 0


if __name__ == "__main__":
    sys.exit(main())
