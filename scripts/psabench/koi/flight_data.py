"""What goes into a flight of the host, and what comes out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from psabench.koi.autocal import FlightEstimate, Knowledge
from psabench.koi.stops import StopLimits
from psabench.koi.take_off import Decision, DecisionLimits, TakeOffLimits
from psabench.koi.trust import TrustLimits
from psabench.link.signals import Floats
from psabench.native.koi import Kind, KoiConfig, Taken, koi_default


@dataclass(frozen=True, slots=True, kw_only=True)
class Fix:
    """A solution of the receiver, on the clock of the increments."""

    t_s: float
    lat_rad: float
    lon_rad: float
    h_m: float
    v_enu_mps: tuple[float, float, float]
    valid: bool = True


@dataclass(frozen=True, kw_only=True)
class FlightSetup:
    """A flight begins parked, and stays so for align_s."""

    cfg: KoiConfig = field(default_factory=koi_default)  # noise and, with `known` None, prior of the sensors
    serial: str = "unit"
    time_s: float = 0.0  # of the beginning, Unix
    known: Knowledge | None = None  # of the unit's passport
    corrects: bool = True  # at take-off, if the decision passes
    place_rad_m: tuple[float, float, float] | None = None  # latitude, longitude, height; None: the receiver's median
    align_s: float = 600.0
    coarse_s: float = 120.0
    stop: StopLimits = field(default_factory=StopLimits)
    take_off: TakeOffLimits = field(default_factory=TakeOffLimits)
    decision: DecisionLimits = field(default_factory=DecisionLimits)
    trust: TrustLimits = field(default_factory=lambda: TrustLimits(taken=600, alone_s=math.inf))  # of the passport


@dataclass(frozen=True, slots=True)
class Event:
    """What the host saw: `aligned`, `stop`, `moves`, `take-off`, `corrected`, `not corrected`, `doubt`."""

    t_s: float
    what: str
    text: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightFound:
    """Of m seconds after the alignment and n states. Rows of solutions as of State.row(): (15,)."""

    names: tuple[str, ...]
    t_s: Floats  # (m,)
    autonomous: Floats  # (m, 15)
    hybrid: Floats
    sd_t_s: Floats  # (k,)
    sd: Floats  # (k, n)
    nis_sum: Mapping[str, Floats]  # by kind of measurement, (k,), from the beginning to sd_t_s
    nis_dof: Mapping[str, Floats]
    events: tuple[Event, ...]
    take_off_s: float | None
    decision: Decision | None  # None: no take-off was seen
    x_take_off: Floats | None  # (n,), before a correction
    x: Floats  # (n,), at the end
    p: Floats  # (n, n)
    taken: Mapping[Kind, Taken]
    estimate: FlightEstimate  # for the passport
    verdict: str  # why it has no weight; nothing: it has
    corrected: bool = False
