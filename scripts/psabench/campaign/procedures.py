"""`psabench campaign`: a table of campaigns, each with its own options, loaded when it is called."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module

from psabench.options import Parser

# Module and help line of each campaign; `parse` of the module takes what follows the name.
CAMPAIGNS: Mapping[str, tuple[str, str]] = {
    "gyrocompass": ("campaign.command", "gyrocompassing with thousands of platforms, each with its own errors"),
    "heading-modes": (
        "campaign.heading_modes_command",
        "a heading indicator for hours: slaved to an induction sensor, free, and self-orienting",
    ),
    "quartz-deformation": (
        "quartz.deformation_command",
        "deformation of a quartz accelerometer's sensing element over temperature, with tolerances",
    ),
    "koi": (
        "koi.fleet.command",
        "strapdown units that fly with a satellite receiver: correction at take-off, learning from flights",
    ),
    "sins-methods": (
        "campaign.sins_methods_command",
        "a strapdown unit calibrated on a rate table by six positions, by Fourier series and by the filter",
    ),
    "sins-plan": ("sins.planner.command", "plan of rotations that calibrates a strapdown unit best"),
    "run-in": ("quartz.run_in_command", "thermal run-in of a production batch of quartz accelerometers"),
    "sins-secondary": (
        "campaign.sins_command",
        "strapdown units that navigate on a rate table, calibrated from their own outputs",
    ),
}
FIRST = "gyrocompass"  # was the only one: its options may precede its name

ABOUT = """\
Run a procedure or a study on thousands of virtual instruments, and compare the distributions with an article's claims.
"""
EPILOG = """\
psabench campaign CAMPAIGN --help lists its options with defaults, and examples.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench campaign`. Raises BadInput."""
    name, rest = split_name(words)
    if name not in CAMPAIGNS:  # an option, or no campaign: the parser says so
        return make_parser().parse_args(words)
    module, _ = CAMPAIGNS[name]
    read: Callable[[Sequence[str]], argparse.Namespace] = import_module(f"psabench.{module}").parse
    args = read(rest)
    args.needs = "campaigns"
    return args


def split_name(words: Sequence[str]) -> tuple[str, list[str]]:
    """The campaign's name, "" for none, and the words without it."""
    if not words or words[0] in ("-h", "--help"):
        return "", list(words)
    at = words.index(FIRST) if words[0].startswith("-") and FIRST in words else 0
    return words[at], [*words[:at], *words[at + 1 :]]


def make_parser() -> argparse.ArgumentParser:
    """Of `psabench campaign` itself: --help and the list of campaigns."""
    top = Parser(prog="psabench campaign", description=ABOUT, epilog=EPILOG)
    names = top.add_subparsers(required=True, metavar="CAMPAIGN")
    for name, (_, line) in CAMPAIGNS.items():
        names.add_parser(name, help=line)
    return top
