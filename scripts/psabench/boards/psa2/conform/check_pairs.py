"""The pairs of Int, Data and CLK: wires A and B at the drivers, outputs of the receivers (article, section 5)."""

from __future__ import annotations

import numpy as np

from psabench.boards.psa2.conform.check_serial import quiet_instants
from psabench.conform.capture.intervals import none_at
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.vcd import Wire

PAIRS = ("Int", "Data", "CLK")
LEAST = 20  # edges that a judgement needs


@check("pairs", "PSA2-SIG-14", needs={"pins", "wires"}, on_recording="stream")
def wires_stand_at_their_rest_levels(e: Capture, row: Requirement) -> str:
    """Look at the wires of the pairs where nothing moves on any of the ports."""
    at_ns = quiet_instants(e, row.limit("quiet_us") * 1e3)
    for name in PAIRS:
        level = int(row.limit(f"{name.lower()}_level"))
        for wire, due in ((f"{name}_A", level), (f"{name}_B", 1 - level)):
            bad = e.wires[wire].at(at_ns) != due
            none_at(at_ns[bad], f"{wire} at {1 - due}", f"{due} at rest", (wire,))
    return f"{2 * len(PAIRS)} wires at {len(at_ns)} instants"


@check("pairs", "PSA2-SIG-14", needs={"pins", "wires"}, on_recording="stream")
def wire_b_is_the_inverse_of_a(e: Capture, row: Requirement) -> str:
    """Compare each edge on a wire A with that on the wire B beside it."""
    for name in PAIRS:
        a, b = e.wires[f"{name}_A"], e.wires[f"{name}_B"]
        _follows(e, f"{name}_B", b, Wire(a.t_ns, 1 - a.level), (0.0, row.limit("skew_max_ns")))
    return f"{', '.join(f'{n}_B' for n in PAIRS)}: every edge against that of A"


@check("pairs", "PSA2-SIG-15", needs={"pins", "wires"}, on_recording="stream")
def receivers_give_what_is_on_the_pairs(e: Capture, row: Requirement) -> str:
    """Compare what a receiver of each pair gives with its wire A."""
    late: list[float] = []
    for name in PAIRS:
        late += _follows(e, name, e.wires[name], e.wires[f"{name}_A"], (0.0, row.limit("delay_max_ns")))
    return f"{', '.join(PAIRS)}: {min(late):.0f} to {max(late):.0f} ns behind the pairs"


def _follows(e: Capture, name: str, w: Wire, due: Wire, late_ns: tuple[float, float]) -> tuple[float, float]:
    """The earliest and the latest edge of a wire after those that it should have. Raises Failed where one is wrong."""
    begin, end = e.wires.start_ns, e.wires.end_ns - round(late_ns[1] + e.slack_ns(late_ns[1]))
    t, t_due = w.t_ns[w.t_ns > begin], due.t_ns[(due.t_ns > begin) & (due.t_ns < end)]
    conclusive(len(t_due) >= LEAST, f"{len(t_due)} edges on the pair of {name}; expected {LEAST}")
    expect(
        len(t) >= len(t_due), f"{len(t)} edges on {name}", f"{len(t_due)}, as on the pair", at_ns=begin, lines=(name,)
    )
    off = (t[: len(t_due)] - t_due).astype(np.float64)
    slack = e.slack_ns(late_ns[1])
    wrong = (off < late_ns[0] - slack) | (off > late_ns[1] + slack) | (w.at(t[: len(t_due)]) != due.at(t_due))
    if wrong.any():
        k = int(np.argmax(wrong))
        saw = f"{name} at {int(w.at(t[k]))}, {off[k]:.0f} ns after the edge on its pair"
        due_words = f"at {int(due.at(t_due[k]))}, {late_ns[0]:.0f} to {late_ns[1] + slack:.0f} ns"
        raise Failed(saw, due_words, at_ns=int(t[k]), lines=(name, f"{name[:-2] if name.endswith('_B') else name}_A"))
    return float(off.min()), float(off.max())
