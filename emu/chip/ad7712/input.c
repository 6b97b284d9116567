#include "chip/ad7712/internal.h"

#include "base/detmath.h"

#include <math.h>

#define BURN_OUT_A 4.5e-6
/* A source behind AIN charges this capacitor through this switch in half a sampling period: the printed resistances that cost
 * no more than 16 bits are linear in that time, with this slope and intercept (sources 3.6). */
#define CAP_F      6.06e-12
#define SWITCH_OHM 7000.0
#define AIN2_OHM   44000.0 /* AD7712: divider of AIN2 to VBIAS */
#define HIGH_LEVEL 4.0     /* which divides by this */

static bool high_level(const struct ad7712 *a, unsigned channel)
{
    return a->cfg.part == AD7712_PART_7712 && channel == 1;
}

double ad7712_attenuation(const struct ad7712 *a, unsigned channel)
{
    return high_level(a, channel) ? HIGH_LEVEL : 1.0;
}

uint32_t ad7712_sampling_hz(const struct ad7712 *a)
{
    const unsigned gain_log2 = ad7712_gain_log2(a);
    return a->cfg.clkin_hz / 256u << (gain_log2 < 3 ? gain_log2 : 3);
}

double ad7712_iout_a(const struct ad7712 *a)
{
    static const double source_a[] = {
        [AD7712_PART_7710] = 20e-6, [AD7712_PART_7711] = 200e-6, [AD7712_PART_7711A] = 400e-6};
    return a->control & AD7712_CTL_B14 ? source_a[a->cfg.part] : 0.0;
}

/* What a source's resistance leaves of its volts; an open input goes to the end of the range with the burn-out current on. */
static double loaded_v(const struct ad7712 *a, unsigned channel, double v, double ohm)
{
    if (ohm <= 0.0) return v;
    if (high_level(a, channel)) return isfinite(ohm) ? v * AIN2_OHM / (AIN2_OHM + ohm) : 0.0;
    const bool burn_out = a->control & AD7712_CTL_BO;
    if (!isfinite(ohm)) return burn_out ? 2.0 * a->cfg.vref_v : 0.0;
    const double half_s = 0.5 / ad7712_sampling_hz(a);
    const double time_constants = half_s / ((ohm + SWITCH_OHM) * CAP_F);
    const double charged = time_constants < 60.0 ? 1.0 - det_exp(-time_constants) : 1.0;
    return (v + (burn_out ? BURN_OUT_A * ohm : 0.0)) * charged;
}

double ad7712_input_v(struct ad7712 *a, int64_t t_ns)
{
    const unsigned channel = ad7712_channel(a);
    if (channel == 1 && a->cfg.part == AD7712_PART_7711A) {
        a->n.bad_channel++;
        return 0.0;
    }
    const double v = a->io.vin_v(a->io.ctx, channel, t_ns);
    return a->io.source_ohm ? loaded_v(a, channel, v, a->io.source_ohm(a->io.ctx, channel, t_ns)) : v;
}
