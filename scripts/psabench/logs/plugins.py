"""Wireshark's dissectors in its folder of personal Lua plugins: ours, and that of our MAVLink dialect from mavgen.

Imports pymavlink, which is the generator.
"""

from __future__ import annotations

import contextlib
import io
import shutil
import tempfile
from pathlib import Path

import pymavlink.dialects.v20
from pymavlink.generator import mavgen, mavparse

from psabench.errors import BadInput, expected, output_error
from psabench.places import proto_file

STANDARD = ("common", "standard", "minimal")  # as psabench.xml includes them, one another
MAVLINK = "psabench_mavlink.lua"


def install_dissectors(shipped: Path, folder: Path) -> list[Path]:
    """Copies of the shipped scripts, and the generated one; they replace earlier ones. Raises BadInput, OutputError."""
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for script in sorted(shipped.glob("*.lua")):
            written.append(folder / script.name)
            shutil.copyfile(script, written[-1])
        written.append(folder / MAVLINK)
        written[-1].write_text(mavlink_dissector(), encoding="utf-8")
    except OSError as e:
        raise output_error(written[-1] if written else folder, e) from e
    return written


def mavlink_dissector() -> str:
    """The text of mavgen's script for proto/mavlink/psabench.xml and what it includes. Raises BadInput."""
    dialects = Path(pymavlink.dialects.v20.__file__).parent
    report = io.StringIO()  # of progress; shown when it fails
    with tempfile.TemporaryDirectory(prefix="psabench-wlua-") as name:
        folder = Path(name)
        for standard in STANDARD:
            shutil.copyfile(dialects / f"{standard}.xml", folder / f"{standard}.xml")
        xml = folder / "psabench.xml"
        shutil.copyfile(proto_file("mavlink/psabench.xml"), xml)
        options = mavgen.Opts(
            str(folder / MAVLINK),
            wire_protocol=mavparse.PROTOCOL_2_0,
            language="WLua",
            validate=False,
            strict_units=False,
        )
        with contextlib.redirect_stdout(report), contextlib.redirect_stderr(report):
            done = mavgen.mavgen(options, [str(xml)])
        if done is False:
            raise BadInput(expected("a dialect that mavgen --lang WLua takes", report.getvalue(), xml.name))
        return (folder / MAVLINK).read_text(encoding="utf-8")
