"""The bench that is shown, lent to a procedure: which ones fit it, how they find it, what is held meanwhile."""

from __future__ import annotations

from collections.abc import Sequence

from psabench.boards.unit import Unit
from psabench.errors import BenchError, expected
from psabench.panel.bench_view import BenchView
from psabench.panel.inbox import ASIDE
from psabench.panel.procedures import OFFERED
from psabench.procedures.command_line.commands import COMMANDS, Command


def fitting_procedures(view: BenchView) -> list[str]:
    """Procedures for which the bench has the board and the instruments, by the tables of `psabench run`."""
    hosts = view.bench.hosts.values()
    if view.pace == "real" or not hosts or any(h.joins_later for h in hosts):  # a serial line has one client
        return []
    return [name for name in OFFERED if _fits_bench(COMMANDS[name], view)]


def _fits_bench(command: Command, view: BenchView) -> bool:
    if not command.takes_bench or _unit_for(command, view) is None:
        return False
    has_axes = "table" not in command.instruments or len(view.tables) >= command.axes
    return has_axes and all(name in view.bench.addresses for name in command.instruments)


def _unit_for(command: Command, view: BenchView) -> Unit | None:
    """The chosen unit where it is such a board, mounted where the procedure has it, else the first that is."""
    units = view.bench.units
    names = [view.unit, *units] if view.unit in units else list(units)
    fit = (n for n in names if units[n].board == command.board and command.on in ("", view.mounts.get(n)))
    return next((units[n] for n in fit), None)


def options_of(name: str, view: BenchView) -> Sequence[str]:
    """That bring the procedure to this bench. Raises BenchError for one that does not fit it."""
    known = fitting_procedures(view)
    if name not in known:
        what = ", ".join(known) or "a bench with the board and the instruments of a procedure"
        raise BenchError(expected(what, repr(name[:40]), "procedure on this bench"))
    command = COMMANDS[name]
    unit = _unit_for(command, view)
    assert unit is not None
    words = ["--control", str(view.bench.control.path)]
    if "--truth" in command.common and view.bench.truth_path is not None:
        words += ["--truth", str(view.bench.truth_path)]
    if "--node" in command.common:
        words += ["--node", str(unit.node.node_id)]
    return words


def check_free(what: str, lent: str) -> None:
    """Raises BenchError for a request that has to wait until the procedure gives the bench back."""
    if lent and what not in ASIDE:
        raise BenchError(f"bench: the procedure {lent} has it; Stop on the card Procedures ends it and gives it back")
