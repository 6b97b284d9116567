/* Conversions that no one looks at: their instants, and their number. */
#include "chip/ads1256/internal.h"

bool ads1256_may_skip(const struct ads1256 *a, double low_v, double high_v)
{
    const bool plain = !a->fault.drdy && !a->fault.dout && !a->fault.lost_sync && !a->fault.clock_ppm;
    const bool buffered = ads1256_value(a, ADS1256_STATUS) & ADS1256_STATUS_BUFEN;
    const double top_v = a->cfg.avdd_v - (buffered ? ADS1256_AVDD_LESS_V : 0.0);
    return plain && a->mode == ADS1256_RUNNING && a->sync && a->ready == 0 && !a->sync_due && !a->cal_due &&
           !a->rdatac && a->rate == a->rate_next && !(ads1256_value(a, ADS1256_ADCON) & ADS1256_ADCON_SDCS) &&
           low_v >= 0.0 && high_v <= top_v && !a->io.source_ohm && a->cfg.part == ADS1256_PART_1256 &&
           ads1256_in_range(a, low_v, high_v);
}

struct ads1256_run ads1256_run_from(const struct ads1256 *a, int64_t t_ns)
{
    const int64_t start_tau = clk_count_at(&a->clkin, t_ns);
    const int64_t ready_tau = start_tau + ads1256_settle_tau(a->rate);
    const int64_t again_tau = ready_tau + ads1256_period_tau(a->rate) - ADS1256_PULSE_TAU;
    return (struct ads1256_run){start_tau, clk_edge_ns(&a->clkin, ready_tau), clk_edge_ns(&a->clkin, again_tau)};
}

struct ads1256_run ads1256_run_now(const struct ads1256 *a)
{
    return ads1256_run_from(a, clk_edge_ns(&a->clkin, a->start_tau));
}

void ads1256_skip(struct ads1256 *a, uint32_t n, uint8_t mux, const struct ads1256_run *last)
{
    a->n.conversions += n;
    a->n.restarts += n;
    reg_poke(&a->regs, ADS1256_MUX, mux);
    ads1256_start_run(a, last->start_tau);
}
