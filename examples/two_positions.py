"""Two positions of the article: an axis of the sensor up, then down. Knows a unit and a head, not where they are.

Without arguments on an emulator started for it; with CAN HEAD [CONTROL] on the bench at these addresses.
"""

import sys

from psabench import Bench


def scale_and_zero(bench: Bench) -> tuple[float, float]:
    """V per g, V: from a_x = -g sin alpha at -90 and 90 deg."""
    bench.unit.wait_ready()
    u_v = {}
    for angle_deg in (-90.0, 90.0):
        bench.head.turn(angle_deg)  # returns when the head stands still
        bench.wait(0.1)  # the converters' filters settle
        u_v[angle_deg] = bench.unit.stream(100).axis("x").mean()
    return (u_v[-90.0] - u_v[90.0]) / 2, (u_v[-90.0] + u_v[90.0]) / 2


if sys.argv[1:]:
    can, head, *control = sys.argv[1:]
    there = Bench.connect(can, scpi={"head": head}, control=control[0] if control else None)
else:
    there = Bench.start("quiet")
with there as bench:
    print("kx {:.5f} V/g, u0 {:.5f} V".format(*scale_and_zero(bench)))
