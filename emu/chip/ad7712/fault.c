#include "chip/ad7712/internal.h"

/* Its own frequency is that of the board's oscillator, whose edges have gone on meanwhile: back to them. Counts that are kept
 * move with the number of the edge. */
static void back_to_own(struct ad7712 *a, int64_t edge, int64_t at_ns)
{
    a->clkin = (struct clk){.hz = a->cfg.clkin_hz, .div = 1};
    const int64_t shift = clk_count_at(&a->clkin, at_ns) - edge;
    a->start_tau += shift;
    a->look.k += shift;
    a->due.k += shift;
}

/* From the next edge on, which keeps its instant and its number. */
static void set_clock(struct ad7712 *a, int64_t hz, int64_t t_ns)
{
    if (hz == a->clkin.hz) return;
    ad7712_sample_until(a, t_ns);
    const int64_t edge = clk_count_at(&a->clkin, t_ns);
    const int64_t at_ns = clk_edge_ns(&a->clkin, edge);
    if (hz == a->cfg.clkin_hz) back_to_own(a, edge, at_ns);
    else a->clkin = chip_fault_clk(&a->clkin, hz, t_ns);
    ad7712_retime(a);
}

void ad7712_fault(struct ad7712 *a, const struct chip_fault *f, int64_t t_ns)
{
    const bool drdy = ad7712_drdy(a), sdata = ad7712_sdata(a, t_ns);
    a->fault = *f;
    if (ad7712_drdy(a) != drdy && a->io.drdy) a->io.drdy(a->io.ctx, !drdy, t_ns);
    if (a->io.sdata && ad7712_sdata(a, t_ns) != sdata) a->io.sdata(a->io.ctx, !sdata, t_ns);
    set_clock(a, chip_fault_hz(f, a->cfg.clkin_hz), t_ns);
    ad7712_follow_pins(a, t_ns); /* a broken SYNC is held high by its pull-up */
}

bool ad7712_flip(struct ad7712 *a, unsigned reg, uint8_t mask, int64_t t_ns)
{
    if (reg >= AD7712_FLIP_REGS || a->state == AD7712_OFF) return false;
    const uint32_t bits = (uint32_t)mask << (16 - 8 * (reg % 3));
    uint32_t *const coef[] = {&a->zero[0], &a->full[0], &a->zero[1], &a->full[1]};
    if (reg < 3) ad7712_load_control(a, a->control ^ bits, t_ns);
    else *coef[reg / 3 - 1] ^= bits;
    return true;
}
