#include "chip/ads1282/internal.h"

#include <stddef.h>

/* From the next edge on, which keeps its instant and its number. */
static void set_clock(struct ads1282 *a, int64_t hz, int64_t t_ns)
{
    if (hz == a->clk.hz) return;
    ads1282_sample_until(a, t_ns);
    a->clk = chip_fault_clk(&a->clk, hz, t_ns);
    ads1282_serial_times(a);
    ads1282_retime(a);
}

void ads1282_fault(struct ads1282 *a, const struct chip_fault *f, int64_t t_ns)
{
    const bool drdy = ads1282_drdy(a);
    a->fault = *f;
    a->io.drdy = f->drdy ? NULL : a->notify_drdy;
    set_clock(a, chip_fault_hz(f, a->cfg.clk_hz), t_ns);
    ads1282_serial_stuck(a);
    if (ads1282_drdy(a) != drdy && a->notify_drdy) a->notify_drdy(a->io.ctx, !drdy, t_ns);
}
