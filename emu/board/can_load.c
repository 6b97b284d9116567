#include "board/can_load.h"

#include <stdio.h>

bool can_load_fits(const struct can_bus_cfg *bus, const char *what, unsigned frames, int64_t need_ns, int64_t have_ns,
                   char *why, size_t cap)
{
    if (have_ns <= 0 || need_ns <= have_ns) return true;
    (void)snprintf(why, cap,
                   "refused: %s is %u frame%s, at worst %.3f us at %lu bit/s, and due every %.3f us (%.0f /s): "
                   "%.1f %% of the bus",
                   what, frames, frames > 1 ? "s" : "", 1e-3 * (double)need_ns, (unsigned long)bus->bitrate_hz,
                   1e-3 * (double)have_ns, 1e9 / (double)have_ns, 100.0 * (double)need_ns / (double)have_ns);
    return false;
}

int64_t can_load_since(struct can_load_mark *m, const struct can_bus *bus, int64_t t_ns)
{
    const struct can_load_mark was = *m;
    *m = (struct can_load_mark){t_ns, can_busy_ns(bus, t_ns)};
    return t_ns > was.t_ns ? (m->busy_ns - was.busy_ns) * 1000 / (t_ns - was.t_ns) : 0;
}
