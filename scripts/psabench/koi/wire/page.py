"""report.html and result.json of a flight, and what the console shows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from psabench.koi.flight_data import FlightFound
from psabench.koi.geodesy import MILE_M
from psabench.koi.wire.params import NAME
from psabench.koi.wire.run import KoiRun
from psabench.koi.wire.truth import Graded
from psabench.native.koi import Kind, Reason, Taken
from psabench.native.nav import ARCMIN, DEGPH
from psabench.report.page import bullets, section, table, verdict_line, whole_page, write_report

SHOWN_NAMES = {"beta3": (ARCMIN, "′"), "alpha1": (ARCMIN, "′"), "nu1_radps": (DEGPH, "°/h"), "df1_mps2": (1.0, "m/s²")}


def verdict_words(run: KoiRun) -> str:
    """One line."""
    f = run.found
    said = [f"{len(f.t_s) + run.params.align_s:.0f} s of flight"]
    said.append("no take-off" if f.take_off_s is None else f"take-off at {f.take_off_s:.0f} s")
    said.append("corrected" if f.corrected else "not corrected")
    if run.graded is not None:
        g = run.graded
        error_m = g.hour_error_m(f.take_off_s)
        if f.take_off_s is not None and math.isfinite(error_m):
            said.append(f"autonomous within {error_m:.0f} m in the hour, {error_m / MILE_M:.2f} miles")
        said.append(f"hybrid {g.hybrid_rms_m:.2f} m rms")
    weight = f"weight {f.estimate.weight:.2f} for the passport" if not f.verdict else "no weight for the passport"
    return "; ".join([*said, weight])


def console_lines(run: KoiRun, *, verbose: bool = False) -> Iterator[str]:
    """What was wrong, what was decided, the verdict."""
    for note in run.notes:
        yield f"NOTE: {note}"
    for e in run.found.events:
        if verbose or e.what in ("aligned", "take-off", "not corrected"):
            yield f"{e.t_s:.0f} s: {e.what}{e.text and f': {e.text}'}"
    if run.found.verdict:
        yield f"NO WEIGHT: {run.found.verdict}"
    yield verdict_words(run)


def result_dict(run: KoiRun) -> dict[str, Any]:
    """result.json. Numbers that are not finite are null."""
    f, feed = run.found, run.feed
    decision = None if f.decision is None else {"passed": f.decision.passed, "reasons": list(f.decision.reasons)}
    estimate = f.estimate
    return {
        "format": 1,
        "procedure": NAME,
        "facts": {"procedure": NAME, **run.facts},
        "params": asdict(run.params),
        "names": list(f.names),
        "events": [asdict(e) for e in f.events],
        "take_off_s": f.take_off_s,
        "decision": decision,
        "corrected": f.corrected,
        "x_take_off": None if f.x_take_off is None else f.x_take_off.tolist(),
        "x": f.x.tolist(),
        "sd": np.sqrt(np.maximum(np.diag(f.p), 0.0)).tolist(),
        "estimate": {
            "names": list(estimate.names),
            "x": estimate.x.tolist(),
            "covariance": estimate.covariance.tolist(),
            "weight": estimate.weight,
        },
        "verdict": f.verdict,
        "measurements": {kind.name.lower(): _measured_dict(t) for kind, t in f.taken.items()},
        "lines": {
            "increments": feed.grid.counts.as_dict(),
            "receiver": feed.stream.counts.as_dict(),
            "receiver_clock": {
                "rate_ppm": feed.clock.rate_ppm,
                "rate_sd_ppm": feed.clock.rate_sd_ppm,
                "jumps": feed.clock.jumps,
                "backwards": feed.clock.backwards,
                "stray": feed.clock.stray,
            },
            "silences": [asdict(s) for s in feed.silences],
            "notes": run.notes,
        },
        "truth": None if run.graded is None else _graded_dict(run.graded, f),
    }


def _measured_dict(t: Taken) -> dict[str, Any]:
    return {
        "counts": {reason.name.lower(): n for reason, n in t.counts.items() if n},
        "nis": t.nis_sum,
        "nis_dof": t.nis_dof,
    }


def _graded_dict(g: Graded, f: FlightFound) -> dict[str, Any]:
    error_m = g.hour_error_m(f.take_off_s)
    every = slice(None, None, 60)
    return {
        "hour_error_m": error_m if math.isfinite(error_m) else None,
        "hybrid_rms_m": g.hybrid_rms_m,
        "t_s": g.t_s[every].tolist(),
        "autonomous_m": g.autonomous_m[every].tolist(),
        "hybrid_m": g.hybrid_m[every].tolist(),
    }


NOTES = (
    "Autonomous: the increments alone, after the alignment and, where the decision passed, one correction at take-off. "
    "Hybrid: with the filter's estimates at each second.",
    "Errors are found less true; the truth is the emulator's log, which the host does not see.",
    "NIS: normalised innovations squared of each kind by degree of freedom, over the whole flight; 1 is expected.",
)


def measurement_rows(f: FlightFound) -> list[list[str]]:
    """Of each kind: accepted, each reason that something was refused for, NIS."""
    seen = [r for r in Reason if r is not Reason.ACCEPTED and any(t.counts[r] for t in f.taken.values())]
    rows = [["", "accepted", *(r.name.lower() for r in seen), "NIS"]]
    for kind in Kind:
        t = f.taken[kind]
        nis = f"{t.nis_sum / t.nis_dof:.3f}" if t.nis_dof else "-"
        rows.append([kind.name.lower(), *(str(t.counts[r]) for r in (Reason.ACCEPTED, *seen)), nis])
    return rows


def write_page(out: Path, run: KoiRun) -> Path:
    """report.html and result.json; the page. Raises OSError, OutputError."""
    from psabench.koi.wire import plots

    f = run.found
    decision = "no take-off was seen" if f.decision is None else "corrected" if f.corrected else "not corrected"
    reasons: Sequence[str] = () if f.decision is None else f.decision.reasons
    events = [["t, s", "", ""], *([f"{e.t_s:.0f}", e.what, e.text] for e in f.events)]
    pictures = list(plots.draw_pictures(run))
    parts = (
        section("Verdict", verdict_line(verdict_words(run), not f.verdict), bullets(_bad_lines(run))),
        section("Take-off", f"<p>{decision}</p>", bullets(list(reasons))),
        *(section(title, picture) for title, picture in pictures),
        section("Measurements", table(measurement_rows(f))),
        section("Events", table(events, numeric=False)),
        section("How to read it", bullets(NOTES)),
    )
    return write_report(out, result_dict(run), whole_page("A flight with a satellite receiver", run.facts, parts))


def _bad_lines(run: KoiRun) -> list[str]:
    return [*([run.found.verdict] if run.found.verdict else []), *run.notes]
