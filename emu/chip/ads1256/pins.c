#include "chip/ads1256/internal.h"

/* Sources 2.4, limits of one edge to the next. T9: DOUT to high impedance, 6 .. 10 tau after the last falling edge. */
enum { T1_TAU = 4, T1_PERIODS = 10, T2H_PERIODS = 9, T2_NS = 200, T4_NS = 50, T5_NS = 50, T9_TAU = 8, T13_TAU = 5 };

/* High times of the reset pattern: t12, t14, t15 (M80); 5 tau of low (t13) between them. */
static const struct {
    uint16_t min_tau, max_tau;
} pattern[] = {{300, 500}, {550, 750}, {1050, 1250}};

#define PATTERN_PULSES (sizeof pattern / sizeof pattern[0])

static void set_dout(struct ads1256 *a, bool driven, bool level, int64_t t_ns)
{
    a->pins.driven = driven;
    if (a->fault.dout) level = a->fault.dout == CHIP_STUCK_HIGH;
    if (level == a->pins.dout) return;
    a->pins.dout = level;
    if (a->io.dout) a->io.dout(a->io.ctx, level, t_ns);
}

static void on_hiz(void *ctx, int64_t t_ns)
{
    set_dout(ctx, false, ADS1256_DOUT_IDLE, t_ns);
}

void ads1256_pins_refresh(struct ads1256 *a, int64_t t_ns)
{
    set_dout(a, a->pins.driven, a->pins.driven && spi_miso(&a->spi), t_ns);
}

void ads1256_pins_init(struct ads1256 *a)
{
    sched_ev_inner(&a->pins.hiz_ev, on_hiz, a);
    a->pins.rise_ns = a->pins.fall_ns = a->pins.din_ns = -NS_PER_S; /* no edge yet */
}

void ads1256_pins_release(struct ads1256 *a, int64_t t_ns)
{
    sched_cancel(a->sched, &a->pins.hiz_ev);
    set_dout(a, false, ADS1256_DOUT_IDLE, t_ns);
    spi_realign(&a->spi);
    a->pins.open = false;
}

/* Counts an SCLK edge out of bounds; true if a strict chip does not see it. */
static bool out_of_bounds(struct ads1256 *a, bool bad)
{
    a->n.sclk_violations += bad;
    return bad && a->cfg.strict_bus;
}

static bool too_long(const struct ads1256 *a, int64_t span_ns, int64_t periods)
{
    return span_ns > ads1256_tau_ns(a, periods * ads1256_period_tau(a->rate_next));
}

/* An SCLK that stops in the middle of a byte: counted, and a strict chip forgets the byte and its command (E0). */
static bool check_sclk_stop(struct ads1256 *a, bool slow, int64_t t_ns)
{
    if (!a->pins.open || !out_of_bounds(a, slow)) return false;
    ads1256_port_drop(a);
    ads1256_pins_release(a, t_ns);
    return true;
}

static void sclk_rise(struct ads1256 *a, int64_t t_ns)
{
    struct ads1256_pins *p = &a->pins;
    const int64_t low_ns = t_ns - p->fall_ns;
    const int64_t period_ns = t_ns - p->rise_ns;
    p->rise_ns = t_ns;
    p->lost = false;
    if (a->cs || ads1256_deaf(a)) return;
    check_sclk_stop(a, too_long(a, period_ns, T1_PERIODS), t_ns);
    p->lost = out_of_bounds(a, period_ns < ads1256_tau_ns(a, T1_TAU) || low_ns < T2_NS);
    if (low_ns < ads1256_tau_ns(a, T13_TAU)) p->pattern = 0;
    if (p->lost) return;
    if (!p->open) {
        p->open = true;
        spi_first(&a->spi, t_ns);
        sched_cancel(a->sched, &p->hiz_ev);
        p->driven = ads1256_has_output(a);
    }
    set_dout(a, p->driven, p->driven && spi_miso(&a->spi), t_ns);
}

/* True when the pulse that ends here completes the pattern. */
static bool pattern_complete(struct ads1256 *a, int64_t high_ns)
{
    struct ads1256_pins *p = &a->pins;
    const unsigned from = p->pattern;
    p->pattern = 0;
    for (unsigned i = from;; i = 0) { /* a pulse that does not go on may begin again */
        const bool fits =
            high_ns >= ads1256_tau_ns(a, pattern[i].min_tau) && high_ns <= ads1256_tau_ns(a, pattern[i].max_tau);
        if (fits) p->pattern = (uint8_t)(i + 1);
        if (fits || i == 0) break;
    }
    return p->pattern == PATTERN_PULSES;
}

static bool taken_bit(struct ads1256 *a, int64_t t_ns)
{
    const bool late = t_ns - a->pins.din_ns < T4_NS;
    a->n.din_violations += late;
    return late && a->cfg.strict_bus ? a->pins.din_was : a->pins.din;
}

static void sclk_fall(struct ads1256 *a, int64_t t_ns)
{
    struct ads1256_pins *p = &a->pins;
    const int64_t high_ns = t_ns - p->rise_ns;
    p->fall_ns = t_ns;
    if (a->cs || ads1256_deaf(a)) return;
    if (pattern_complete(a, high_ns)) {
        p->pattern = 0;
        ads1256_reset_chip(a, ADS1256_SYNC_LOW, 0, t_ns); /* CLK is reset as by the pin (E0) */
        ads1256_go(a, t_ns);
        return;
    }
    if (check_sclk_stop(a, too_long(a, high_ns, T2H_PERIODS), t_ns)) return;
    if (out_of_bounds(a, high_ns < T2_NS) || p->lost) return;
    if (!p->open) spi_first(&a->spi, t_ns); /* CS fell while SCLK was high */
    spi_sample(&a->spi, taken_bit(a, t_ns), t_ns);
    p->open = a->spi.bits != 0;
    if (p->driven && !p->open && !ads1256_has_output(a))
        sched_at(a->sched, &p->hiz_ev, t_ns + ads1256_tau_ns(a, T9_TAU));
}

void ads1256_sclk_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    if (level == a->pins.sclk) return;
    a->pins.sclk = level;
    if (level) sclk_rise(a, t_ns);
    else sclk_fall(a, t_ns);
}

void ads1256_din_pin(struct ads1256 *a, bool level, int64_t t_ns)
{
    struct ads1256_pins *p = &a->pins;
    if (level == p->din) return;
    a->n.din_violations += !a->cs && !ads1256_deaf(a) && t_ns - p->fall_ns < T5_NS;
    p->din_was = p->din;
    p->din = level;
    p->din_ns = t_ns;
}

bool ads1256_dout(const struct ads1256 *a)
{
    return a->pins.dout;
}
