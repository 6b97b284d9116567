#include "chip/ads1256/internal.h"

#include <stddef.h>

/* From the next edge on, which keeps its instant and its number. */
static void set_clock(struct ads1256 *a, int64_t hz, int64_t t_ns)
{
    if (hz == a->clkin.hz) return;
    a->clkin = chip_fault_clk(&a->clkin, hz, t_ns);
    ads1256_retime(a);
}

void ads1256_fault(struct ads1256 *a, const struct chip_fault *f, int64_t t_ns)
{
    const bool drdy = ads1256_drdy(a);
    a->fault = *f;
    a->io.drdy = f->drdy ? NULL : a->notify_drdy;
    set_clock(a, chip_fault_hz(f, a->cfg.clkin_hz), t_ns);
    if (f->lost_sync) ads1256_sync_pin(a, true, t_ns); /* the wire is broken, a pull-up holds the pin */
    spi_load(&a->spi, ads1256_on_wire(a, a->spi.out));
    ads1256_pins_refresh(a, t_ns);
    if (ads1256_drdy(a) != drdy && a->notify_drdy) a->notify_drdy(a->io.ctx, !drdy, t_ns);
}
