"""`psabench run thermal`: opens or continues a bench, measures, grades, reports.

A run of ours on an emulator is resumed from its last checkpoint, at the same instant with the same noise: the digits
are those of a run in one piece. On a bench that is there already time has passed, so an interrupted temperature or
sweep begins again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.bench import Bench
from psabench.boards.psa2.device import Psa2
from psabench.boards.registry import DBC_NODE
from psabench.budget.accuracy import EXACT, BenchAccuracy
from psabench.errors import BadInput, expected
from psabench.instruments import EXAMPLES
from psabench.procedures.command_line.offered import G_MPS2, SITE_G_MPS2
from psabench.procedures.head_bench import Progress
from psabench.procedures.result import fields_of, made_params
from psabench.report import provenance
from psabench.thermal.bench import WireThermal
from psabench.thermal.measure import RunStart, ThermalWatch, measure_schedule, restarted_origin, whole_parts
from psabench.thermal.records import Recording, RunFolder, read_recordings, recording_row, whole_lines
from psabench.thermal.result import ThermalResult, estimate_run
from psabench.thermal.schedule import (
    Schedule,
    Take,
    planned_actions,
    read_schedule,
    schedule_dict,
    schedule_of_dict,
)

SCENARIO = "quartz_run_in"
FIXED = ("schedule", "scenario", "seed", "gravity")  # of a run that is resumed: they are in its folder


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalOptions:
    """What the command line asked for."""

    out: Path
    schedule: str | None = None
    resume: Path | None = None
    can: str | None = None
    head: str | None = None
    chamber: str | None = None
    control: Path | None = None
    truth: Path | None = None
    scenario: Path | None = None
    node: int = DBC_NODE
    seed: int | None = None
    gravity: float | None = None
    real_time: bool = False
    fresh: bool = False  # recordings of an earlier run in the folder go
    params: dict[str, Any] = field(default_factory=dict)  # of BenchAccuracy


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalRun:
    """A run that is over."""

    result: ThermalResult
    folder: RunFolder
    facts: dict[str, str]


@contextmanager
def run_thermal(options: ThermalOptions, progress: Progress) -> Iterator[ThermalRun]:
    """Measure and estimate. Raises BadInput, BenchError; what was recorded stays.

    The folder is this process's alone until the context ends. Its report is written within; after that nothing is
    left to go on from, and checkpoints go.
    """
    folder = RunFolder(options.resume or options.out)
    new = None if options.resume else _new_setup(options)
    with folder.own_folder():
        if new is not None:
            _refuse_kept(options, folder)
        setup = _resumed_setup(options, folder) if new is None else new
        yield _run_of(options, setup, folder, progress)
        folder.drop_checkpoints()


def _run_of(options: ThermalOptions, setup: dict[str, Any], folder: RunFolder, progress: Progress) -> ThermalRun:
    schedule = schedule_of_dict(setup["schedule"], str(folder.setup_path), str(setup["name"]))
    recordings = _whole_recordings(setup, folder, schedule) if options.resume else None
    if recordings is not None:
        provenance.note_recorded(setup)
    else:
        with ExitStack() as stack:
            recordings = _Session(options, setup, folder, schedule, stack).measure_rest(progress)
    given = {**setup["accuracy"], **fields_of(BenchAccuracy, options.params)}
    accuracy = _accuracy_of(given, exact=bool(setup["ours"]) and not setup["scenario"])
    result = estimate_run(recordings, schedule, float(setup["g_mps2"]), accuracy)
    return ThermalRun(result=result, folder=folder, facts=_facts_of(setup))


def _accuracy_of(given: dict[str, Any], *, exact: bool) -> BenchAccuracy:
    """Nothing is hidden in the chain and the head of our own scenario; else what the user gives, or our figures."""
    return made_params(BenchAccuracy, "accuracy of the bench", {**(EXACT if exact else {}), **given})


def _refuse_kept(options: ThermalOptions, folder: RunFolder) -> None:
    """Hours of recordings are not overwritten but on request. Raises BadInput."""
    rows = max(len(whole_lines(folder.data)) - 1, 0)
    if not rows or options.fresh:
        return
    complete = _is_complete(folder)
    resumed = "for its report again" if complete else "to continue its run"
    what = f"another folder, --resume {folder.path} {resumed}, or --fresh to measure again"
    state = "complete" if complete else "not complete"
    raise BadInput(expected(what, f"one with {rows} recordings of a run that is {state}", "--out"))


def _is_complete(folder: RunFolder) -> bool:
    """Whether every recording of its schedule is there; a result.json may be of another procedure."""
    try:
        setup = folder.read_setup()
        schedule = schedule_of_dict(setup["schedule"], str(folder.setup_path), str(setup["name"]))
        return _whole_recordings(setup, folder, schedule) is not None
    except BadInput:
        return False


def _is_there(options: ThermalOptions) -> bool:
    """Whether the bench is there already; else an emulator is started."""
    return bool(options.can or options.head or options.chamber or options.control)


def _new_setup(options: ThermalOptions) -> dict[str, Any]:
    schedule = read_schedule(options.schedule or "quick")
    there = _is_there(options)
    default_g = G_MPS2 if there or options.scenario else SITE_G_MPS2
    return {
        "name": schedule.name,
        "schedule": schedule_dict(schedule),
        "ours": not there,
        "scenario": str(options.scenario) if options.scenario else "",
        "seed": options.seed,
        "node": options.node,
        "accuracy": fields_of(BenchAccuracy, options.params),
        "g_mps2": default_g if options.gravity is None else options.gravity,
    }


def _resumed_setup(options: ThermalOptions, folder: RunFolder) -> dict[str, Any]:
    given = [f"--{name}" for name in FIXED if getattr(options, name) is not None]
    given += ["--fresh"] if options.fresh else []
    if given:
        raise BadInput(expected("no option that the run has already", ", ".join(given), "--resume"))
    setup = folder.read_setup()
    if setup["ours"] == _is_there(options):
        what = "no addresses: its emulator is started again" if setup["ours"] else "the addresses of its bench"
        raise BadInput(expected(what, "others", "--resume"))
    return setup


def _facts_of(setup: dict[str, Any]) -> dict[str, str]:
    bench = setup["scenario"] or (SCENARIO if setup["ours"] else "a bench that was there")
    return {"schedule": str(setup["name"]), "bench": str(bench), "g": f"{setup['g_mps2']:g} m/s²"}


# ---- the bench


class _Session:
    """The bench of one run, its files, and what is kept of a run before."""

    def __init__(
        self, options: ThermalOptions, setup: dict[str, Any], folder: RunFolder, schedule: Schedule, stack: ExitStack
    ) -> None:
        self._setup, self._folder, self._schedule, self._stack = setup, folder, schedule, stack
        self._kept: list[Recording] = []
        self._resumed = options.resume is not None
        if options.resume:
            self._bench = self._continue_bench(options)
        else:
            self._bench = stack.enter_context(_opened_bench(options, setup, folder))
        b = self._bench
        self._wire = WireThermal(_unit_at(b, int(setup["node"])), b.head, b.chamber, schedule.samples_hz)
        self._checkpoints = b.emulator is not None

    def _continue_bench(self, options: ThermalOptions) -> Bench:
        """Ours at its last checkpoint, or from the beginning; one that was there as it is now."""
        rows = len(read_recordings(self._folder.data))
        found = self._folder.last_checkpoint(rows) if self._setup["ours"] else None
        if found is None:
            if rows and self._setup["ours"]:
                self._folder.set_aside(0)
            return self._stack.enter_context(_opened_bench(options, self._setup, self._folder))
        pace = "wall" if options.real_time else "step"
        bench = self._stack.enter_context(Bench.restore(found[1], pace=pace))
        self._kept = self._folder.keep_rows(found[0])
        return bench

    def _begun_run(self) -> RunStart:
        """Prepare the unit, or go on. A run begins at a whole second, so that its times are exact."""
        if self._kept:
            self._wire.resume()
            return RunStart(origin_s=float(self._setup["origin_s"]), chamber_degc=float(self._setup["start_degc"]))
        self._wire.prepare()
        if self._resumed and not self._setup["ours"]:
            return self._go_on_there()
        start = RunStart(origin_s=float(int(self._wire.t_s) + 1), chamber_degc=self._wire.chamber_degc())
        scenarios = provenance.noted_scenarios()
        if self._resumed and self._setup.get("scenarios", scenarios) != scenarios:
            what = "the scenario and the seed that the run began with"
            raise BadInput(expected(what, "others", f"{self._folder.path}: {self._setup['scenario'] or SCENARIO}"))
        self._setup |= {"origin_s": start.origin_s, "start_degc": start.chamber_degc, "scenarios": scenarios}
        self._folder.store_setup(self._setup)
        return start

    def _go_on_there(self) -> RunStart:
        """On a bench that was there: complete temperatures and sweeps are kept, the one that was cut begins again."""
        degc = float(self._setup["start_degc"])
        actions = planned_actions(self._schedule, degc)
        taken = len(read_recordings(self._folder.data))
        whole = whole_parts(actions, taken)
        if whole < taken:
            self._folder.set_aside(whole)
        self._kept = self._folder.keep_rows(whole)
        if whole == sum(isinstance(a, Take) for a in actions):
            return RunStart(origin_s=float(self._setup["origin_s"]), chamber_degc=degc)
        return RunStart(origin_s=restarted_origin(self._wire, actions, whole), chamber_degc=degc)

    def measure_rest(self, progress: Progress) -> list[Recording]:
        """All recordings; raises as `measure_schedule`, with those so far stored."""
        start = self._begun_run()
        with self._folder.open_series() as series, self._truth_store() as note_truth:

            def store(r: Recording) -> None:
                note_truth(r)
                series.store_rows([recording_row(r)])

            watch = ThermalWatch(store=store, checkpoint=self._checkpoint, progress=progress)
            return measure_schedule(self._wire, self._schedule, start, watch, self._kept)

    def _checkpoint(self, rows: int) -> None:
        if self._checkpoints:
            self._folder.store_checkpoint(rows, self._bench.snapshot)

    @contextmanager
    def _truth_store(self) -> Iterator[Any]:
        """What the emulator knows at each recording, for graders."""
        if self._bench.truth_path is None:
            yield lambda r: None
            return
        axes = next(iter(self._bench.truth()["units"].values()))["axes"]
        load_ohm = [float(axes[a]["afe"]["load_ohm"]) for a in "xyz"]
        with self._folder.open_truth() as series:
            yield lambda r: series.store_rows([_truth_row(r, self._bench.truth_state(), load_ohm)])


def _unit_at(bench: Bench, node: int) -> Psa2:
    """The PSA-2 of this node, among all of a bench that was restored; else its first one."""
    found = (u for u in bench.units.values() if isinstance(u, Psa2) and u.node.node_id == node)
    return next(found, None) or bench.unit


def _truth_row(r: Recording, state: dict[str, Any], load_ohm: Sequence[float]) -> list[object]:
    unit = state["unit"]
    g_mps2 = math.hypot(*unit["f_mps2"])
    a = [-float(f) / g_mps2 for f in unit["f_mps2"]]
    sensors = zip(unit["sensor_v"], unit["sensor_a"], load_ohm, strict=True)  # one of the two outputs is 0
    out_v = [float(v) + float(i) * load for v, i, load in sensors]
    return [r.t_s, unit["case_degc"], unit["element_degc"], *a, *out_v]


def _whole_recordings(setup: dict[str, Any], folder: RunFolder, schedule: Schedule) -> list[Recording] | None:
    """Of a run that needs only its report; None: something is missing."""
    found = read_recordings(folder.data)
    actions = planned_actions(schedule, float(setup["start_degc"]))
    return found if len(found) == sum(isinstance(a, Take) for a in actions) else None


def _opened_bench(options: ThermalOptions, setup: dict[str, Any], folder: RunFolder) -> Bench:
    if not setup["ours"]:
        if not options.control and not (options.head and options.chamber):
            raise BadInput(expected(f"the VISA addresses of --head and --chamber, as {EXAMPLES}", "not both", "run"))
        given = {"head": options.head, "chamber": options.chamber}
        scpi = {name: address for name, address in given.items() if address}
        return Bench.connect(
            options.can, scpi=scpi, control=options.control, truth=options.truth, node=int(setup["node"])
        )
    folder.path.mkdir(parents=True, exist_ok=True)
    scenario = setup["scenario"] or SCENARIO
    if setup["scenario"]:
        provenance.note_file("scenario", Path(setup["scenario"]))
    pace = "wall" if options.real_time else "step"
    return Bench.start(scenario, pace=pace, seed=setup["seed"], node=setup["node"])
