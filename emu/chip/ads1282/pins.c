#include "chip/ads1282/internal.h"

/* SCLK, DIN and DOUT edge by edge, and the limits of sources 1.4: a breach is counted and has no other effect. */

#define SCLK_MIN_TCLK   2  /* period; M75 */
#define SCLK_MAX_TCLK   16 /* inside a byte; M75 */
#define WIDTH_MIN_NUM   4  /* 0.8 tCLK high, low; M75 */
#define WIDTH_MIN_DEN   5
#define WIDTH_MAX_TCLK  10 /* high; low inside a byte; M75 */
#define DIN_SETUP_NS    50 /* M80, D sister */
#define DIN_HOLD_NS     50
#define DRDY_TO_SCLK_NS 100 /* DOUT's first bit; M70, C */

/* More or less than counts/den of CLK; compared in 1/hz s, so that nothing is rounded. */
static bool is_shorter(const struct ads1282 *a, int64_t dt_ns, int64_t counts, int64_t den)
{
    return dt_ns < clk_span_ns(a->clk.hz * den, counts);
}

static bool is_longer(const struct ads1282 *a, int64_t dt_ns, int64_t counts)
{
    return dt_ns > clk_span_ns(a->clk.hz, counts) + 1; /* edges are rounded to a nanosecond */
}

static void check_rise(struct ads1282 *a, int64_t t_ns)
{
    struct ads1282_pins *p = &a->pin;
    const bool inside = a->spi.bits > 0;
    const int64_t period_ns = t_ns - p->sclk_rise_ns;
    const int64_t low_ns = t_ns - p->sclk_fall_ns;
    a->limit.sclk_period +=
        is_shorter(a, period_ns, SCLK_MIN_TCLK, 1) || (inside && is_longer(a, period_ns, SCLK_MAX_TCLK));
    a->limit.sclk_width +=
        is_shorter(a, low_ns, WIDTH_MIN_NUM, WIDTH_MIN_DEN) || (inside && is_longer(a, low_ns, WIDTH_MAX_TCLK));
    a->limit.din_setup += t_ns - p->din_ns < DIN_SETUP_NS;
    a->limit.drdy_to_sclk += a->word_out && !a->drdy && t_ns - p->drdy_ns < DRDY_TO_SCLK_NS;
}

static void sclk_rise(struct ads1282 *a, int64_t t_ns)
{
    struct ads1282_pins *p = &a->pin;
    check_rise(a, t_ns);
    p->sclk_rise_ns = t_ns;
    if (!a->alive) return;
    if (a->spi.bits == 0) ads1282_serial_gap(a, t_ns);
    p->dout_held = spi_miso(&a->spi);
    a->sclk_ns = t_ns;
    spi_sample(&a->spi, p->din, t_ns);
}

static void sclk_fall(struct ads1282 *a, int64_t t_ns)
{
    struct ads1282_pins *p = &a->pin;
    const int64_t high_ns = t_ns - p->sclk_rise_ns;
    a->limit.sclk_width +=
        is_shorter(a, high_ns, WIDTH_MIN_NUM, WIDTH_MIN_DEN) || is_longer(a, high_ns, WIDTH_MAX_TCLK);
    p->sclk_fall_ns = t_ns;
    if (!a->alive) return;
    if (a->spi.bits == 1) spi_first(&a->spi, t_ns);
    else ads1282_serial_fall(a, t_ns);
}

void ads1282_sclk_pin(struct ads1282 *a, bool level, int64_t t_ns)
{
    if (level == a->pin.sclk) return;
    a->pin.sclk = level;
    if (level) sclk_rise(a, t_ns);
    else sclk_fall(a, t_ns);
}

void ads1282_din_pin(struct ads1282 *a, bool level, int64_t t_ns)
{
    struct ads1282_pins *p = &a->pin;
    if (level == p->din) return;
    p->din = level;
    p->din_ns = t_ns;
    a->limit.din_hold += t_ns - p->sclk_rise_ns < DIN_HOLD_NS;
}

/* Without power and in reset the shift register holds zeros. */
bool ads1282_dout(const struct ads1282 *a)
{
    if (a->fault.dout) return a->fault.dout == CHIP_STUCK_HIGH;
    return a->pin.sclk ? a->pin.dout_held : spi_miso(&a->spi);
}
