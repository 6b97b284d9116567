"""Options of `psabench run` as argparse takes them: who takes which is in commands.py."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from psabench.boards.registry import DBC_NODE
from psabench.instruments import EXAMPLES
from psabench.options import natural, node_id, positive, report_folder
from psabench.output import FLAG
from psabench.passport.command import STORE
from psabench.procedures.command_line.offered import CONDITIONS, G_MPS2

# Options of more than one procedure.
COMMON: Mapping[str, Mapping[str, Any]] = {
    "--condition": {
        "choices": [*CONDITIONS, "both"],
        "default": "both",
        "help": "emulated bench (%(default)s)",
    },
    "--scenario": {"type": Path, "metavar": "FILE", "help": "scenario of the emulator (the procedure's default)"},
    "--passport": {
        "type": Path,
        "metavar": "FILE",
        "help": "nominal values of the sensor to compare with: YAML of u0_v, kx_v_per_g ... (the scenario's)",
    },
    "--can": {
        "metavar": "BUS",
        "help": "CAN bus of an existing bench, as INTERFACE:CHANNEL[,key=value...] of python-can: "
        "socketcand:127.0.0.1:29536, slcan:/dev/pts/7, socketcan:vcan0,fd=true. Default: the bus that --control names",
    },
    "--head": {
        "metavar": "VISA-ADDRESS",
        "help": f"dividing head, real or emulated: {EXAMPLES}. Bus without --can: python-can's configuration",
    },
    "--control": {
        "type": Path,
        "metavar": "SOCKET",
        "help": "control socket of a running emulator; its bus and instruments are used",
    },
    "--truth": {
        "type": Path,
        "metavar": "SOCKET",
        "help": "truth socket of an emulator, read after the run to compare the results",
    },
    "--node": {"type": node_id, "default": DBC_NODE, "metavar": "N", "help": "CANopen node of the unit (%(default)s)"},
    "--average": {
        "type": natural,
        "metavar": "N",
        "help": f"samples per reading; 0: whole 32-bit words by SDO (quiet {CONDITIONS['quiet'].average}, "
        f"else {CONDITIONS['realistic'].average})",
    },
    "--gravity": {
        "type": positive,
        "metavar": "M/S2",
        "help": f"local g, m/s^2 (the scenario's, else {G_MPS2})",
    },
    "--seed": {"type": int, "metavar": "N", "help": "random seed; overrides the scenario"},
    "--real-time": {"action": "store_true", "help": "run at wall-clock pace"},
    "--record": {
        "type": Path,
        "metavar": "FILE",
        "help": "store the frames of the run in a log (.log .blf .asc ...) and its calls in FILE.calls.csv",
    },
    "--replay": {"type": Path, "metavar": "FILE", "help": "run on such a log instead of a bench"},
    "--out": {
        "type": report_folder,
        "default": Path("build/run"),
        "metavar": "FOLDER",
        "help": "report folder (%(default)s)",
    },
    "--lcm": {
        "metavar": "URL",
        "help": "publish progress and results with LCM: udpm://GROUP:PORT, or file://PATH an event log",
    },
    "--verbose": {"action": "store_true", "help": "print the tables of results as well"},
}
# Of every procedure: each writes a report.
OF_A_REPORT: Mapping[str, Mapping[str, Any]] = {
    "--json": {**FLAG, "help": "print the report's result.json instead of text"},
}
# Of the calibration on a rate table alone.
ON_THE_TABLE: Mapping[str, Mapping[str, Any]] = {
    "--table": {"metavar": "VISA-ADDRESS", "help": f"rate table, real or emulated: {EXAMPLES}"},
    "--data": {
        "type": Path,
        "metavar": "PATH",
        "help": "a recording in place of a bench: a file of increments; of a flight, OUT of its run",
    },
    "--layout": {
        "type": Path,
        "metavar": "FILE",
        "help": "what the recording's columns are (docs/procedures/sins_data.md)",
    },
    "--angles": {"type": Path, "metavar": "FILE", "help": "angles of the table, as table_angles.csv of a run"},
}
# Recordings of a unit that navigates.
FROM_OUTPUTS: Mapping[str, Mapping[str, Any]] = {
    "--first": {
        "type": Path,
        "metavar": "FILE",
        "help": "recording of the experiment that calibrates: what the unit gave out, CSV",
    },
    "--second": {
        "type": Path,
        "metavar": "FILE",
        "help": "recording of the experiment that is compensated; none: calibrate alone",
    },
}
# Of the thermal run alone.
IN_THE_CHAMBER: Mapping[str, Mapping[str, Any]] = {
    "--schedule": {"metavar": "NAME|FILE", "help": "quick, full or a YAML file (quick)"},
    "--resume": {"type": Path, "metavar": "FOLDER", "help": "continue the run of this folder where it was interrupted"},
    "--fresh": {"action": "store_true", "help": "measure again in a folder that has recordings; they go"},
    "--chamber": {"metavar": "VISA-ADDRESS", "help": f"thermal chamber, real or emulated: {EXAMPLES}"},
}

# Of compare-converters alone: its chamber is in its scenario.
CONVERTERS_ALONE: Mapping[str, Mapping[str, Any]] = {
    "--chamber": {"action": "store_true", "help": "compare them at temperatures of a chamber: drift of zero and scale"},
}

# Of the calibrations on the head, one at a time.
IN_A_CLIMATE: Mapping[str, Mapping[str, Any]] = {
    "--climate": {"action": "store_true", "help": "repeat it at temperatures of a chamber, with the scenario climate"},
}

# Of the test turns alone.
OF_A_BATCH: Mapping[str, Mapping[str, Any]] = {
    "--batch": {"action": "store_true", "help": "all sensors of all units in one pass, with the scenario batch"},
}

# Of flights alone.
IN_FLIGHT: Mapping[str, Mapping[str, Any]] = {
    "--store": {"type": Path, "default": STORE, "metavar": "FILE", "help": "store of passports (%(default)s)"},
    "--receiver": {"metavar": "PORT", "help": "serial port of the satellite receiver (the emulator's only one)"},
}

EVERY: Mapping[str, Mapping[str, Any]] = {
    **COMMON,
    **IN_THE_CHAMBER,
    **ON_THE_TABLE,
    **FROM_OUTPUTS,
    **IN_FLIGHT,
    **OF_A_REPORT,
}
