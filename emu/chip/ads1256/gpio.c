#include "chip/ads1256/internal.h"

static unsigned pins_of(const struct ads1256 *a)
{
    return a->cfg.part == ADS1256_PART_1255 ? 2 : ADS1256_GPIOS;
}

static unsigned pin_mask(const struct ads1256 *a)
{
    return (1u << pins_of(a)) - 1;
}

/* D0 is a pin of the IO register only while CLKOUT is off (M70). */
static unsigned output_mask(const struct ads1256 *a)
{
    const unsigned clock = ads1256_value(a, ADS1256_ADCON) & ADS1256_ADCON_CLK ? 1 : 0;
    return ~(unsigned)ads1256_value(a, ADS1256_IO) >> 4 & pin_mask(a) & ~clock;
}

static void notify_levels(struct ads1256 *a, unsigned levels, int64_t t_ns)
{
    const unsigned changed = (levels ^ a->dio_notified) & output_mask(a);
    a->dio_notified = (uint8_t)((a->dio_notified & ~output_mask(a)) | (levels & output_mask(a)));
    if (!a->io.gpio) return;
    for (unsigned d = 0; d < ADS1256_GPIOS; d++) {
        if (changed >> d & 1) a->io.gpio(a->io.ctx, d, levels >> d & 1, t_ns);
    }
}

/* A read of DIO shows the pins, whether they are inputs or outputs (SBAS288 p. 23). */
void ads1256_gpio_show(struct ads1256 *a, int64_t t_ns)
{
    const unsigned io = ads1256_value(a, ADS1256_IO);
    const unsigned in = io >> 4 & pin_mask(a);
    const unsigned levels = (a->dio_latch & ~in) | (a->dio_in & in);
    reg_poke(&a->regs, ADS1256_IO, (uint8_t)((io & ~ADS1256_IO_DIO) | levels));
    notify_levels(a, levels, t_ns);
}

void ads1256_gpio_written(void *chip, uint8_t was, uint8_t now, int64_t t_ns)
{
    (void)was;
    struct ads1256 *a = chip;
    a->dio_latch = now & ADS1256_IO_DIO;
    ads1256_gpio_show(a, t_ns);
}

void ads1256_gpio_pin(struct ads1256 *a, unsigned d, bool level, int64_t t_ns)
{
    if (d >= pins_of(a)) return;
    a->dio_in = (uint8_t)((a->dio_in & ~(1u << d)) | (unsigned)level << d);
    ads1256_gpio_show(a, t_ns);
}

/* Half periods of CLKOUT from a count, high first. */
static bool clkout_level(const struct ads1256 *a)
{
    const struct clk half = {.hz = 2 * (int64_t)ads1256_clkout_hz(a), .div = 1};
    const int64_t now_ns = a->sched->now_ns;
    const int64_t k = clk_count_at(&half, now_ns);
    return (k - (clk_edge_ns(&half, k) > now_ns)) % 2 == 0;
}

bool ads1256_gpio(const struct ads1256 *a, unsigned d)
{
    if (d >= pins_of(a)) return false;
    if (d == 0 && ads1256_clkout_hz(a)) return clkout_level(a);
    return ads1256_value(a, ADS1256_IO) >> d & 1;
}

bool ads1256_gpio_is_output(const struct ads1256 *a, unsigned d)
{
    return d < ADS1256_GPIOS && ((output_mask(a) >> d & 1) || (d == 0 && ads1256_clkout_hz(a)));
}

/* Runs through standby, stops with the oscillator (SBAS288 p. 23). */
uint32_t ads1256_clkout_hz(const struct ads1256 *a)
{
    static const uint8_t div[] = {0, 1, 2, 4};
    const unsigned code = (ads1256_value(a, ADS1256_ADCON) & ADS1256_ADCON_CLK) >> 5;
    return div[code] && a->mode != ADS1256_OFF ? (uint32_t)(a->clkin.hz / div[code]) : 0;
}
