"""Paths, sockets and ports that cannot be used: every command, every option that takes one.

One line in the form `<where>: expected <what>, got <value>`, the exit status of docs/limits.md, nothing on stdout.
Root may read and write everything: what has no permission is shown by a path below a regular file.
"""

from __future__ import annotations

import argparse
import re
import socket
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from psabench import cli
from psabench.errors import BadInput, LinkError

from tests.py.shell.test_json_output import every_command

FORM = re.compile(r"psabench: \S.*: expected [^,].*, got \S.*\n")
SYSTEM_TEXTS = ("No such file", "Is a directory", "Not a directory", "Errno", "Permission denied", "Connection refused")
INPUT, FILE, FOLDER, PORT = "input", "output file", "output folder", "port"
# By the name of an option or an argument. (command, name): of one command, where others have another kind.
KINDS: Mapping[str | tuple[str, str], str] = {
    "--scenario": INPUT,
    "--passport": INPUT,
    "--replay": INPUT,
    "--data": INPUT,
    "--layout": INPUT,
    "--angles": INPUT,
    "--first": INPUT,
    "--second": INPUT,
    "--schedule": INPUT,
    "--resume": INPUT,
    "--batch": INPUT,
    "--experiment": INPUT,
    "--calibration": INPUT,
    "--log": INPUT,
    "--recording": INPUT,
    "--store": FILE,
    "file": INPUT,
    "files": INPUT,
    "folders": INPUT,
    "recording": INPUT,
    "calibration": INPUT,
    "result": INPUT,
    "a": INPUT,
    "b": INPUT,
    "--out": FOLDER,
    "out": FILE,
    "--record": FILE,
    "--svg": FILE,
    "--wavedrom": FILE,
    "--dir": FOLDER,
    "--results": FILE,
    ("decode", "--out"): FILE,
    ("decode", "--store"): INPUT,
    ("record", "file"): FILE,
    ("passport export", "--out"): FILE,
    ("passport header", "--out"): FILE,
    ("passport list", "--store"): INPUT,
    ("passport show", "--store"): INPUT,
    ("passport diff", "--store"): INPUT,
    ("passport export", "--store"): INPUT,
    ("passport header", "--store"): INPUT,
    ("nav apply", "--out"): FILE,
    ("nav header", "--out"): FILE,
    "--control": PORT,
    "--connect": PORT,
    "--truth": PORT,
    "--lines": PORT,
    "--bus-port": PORT,
    "--receiver": PORT,
    "port": PORT,
}
