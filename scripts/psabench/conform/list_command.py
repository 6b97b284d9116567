"""`psabench conform list`: the requirements of a board."""

from __future__ import annotations

import argparse

from psabench.conform.profile import Variant, variant
from psabench.conform.requirements import Requirement, requirements


def list_requirements(args: argparse.Namespace) -> int:
    """Handler of `conform list`."""
    for r in requirements_of(variant(args.board, args.profile)):
        print(f"{r.id:16} {r.grade} {'/'.join(r.observe) or '-':16} {r.text}")
    return 0


def requirements_of(v: Variant) -> list[Requirement]:
    """Those of a board in a profile, without those of its hosts."""
    return [r for r in requirements() if r.group != "host" and r.applies(v.board, v.profile)]
