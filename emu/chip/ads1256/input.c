#include "chip/ads1256/internal.h"

#include <math.h>

#define RMUX_OHM   25.0 /* of each side, SBAS288 p. 15 */
#define BEYOND_V   0.1  /* range of the pins outside the supplies */
#define NOMINAL_HZ 7.68e6
#define OPEN_OHM   1e12

/* Effective impedance without buffer at 7.68 MHz, by log2 of the gain: of each pin to AVDD/2, and between the two.
 * SBAS288 p. 17, table 10. Both together are the 150 kohm / PGA of the electrical characteristics. */
static const struct {
    double pin_kohm, between_kohm;
} load[ADS1256_GAINS] = {{260, 220}, {130, 110}, {65, 55}, {33, 28}, {16, 14}, {8, 7}, {8, 7}};

static const double detect_a[] = {0.0, 0.5e-6, 2e-6, 10e-6};

static bool is_absent(const struct ads1256 *a, unsigned ain)
{
    return a->cfg.part == ADS1256_PART_1255 && ain > 1 && ain < ADS1256_AINCOM;
}

static inline unsigned ain_of(unsigned select)
{
    return select > ADS1256_AINCOM ? ADS1256_AINCOM : select;
}

/* Voltage of the open circuit. What an ADS1255 does not have is taken as AGND (E0): what floats there no one knows. */
static inline double open_v(struct ads1256 *a, unsigned select, int64_t t_ns)
{
    const unsigned ain = ain_of(select);
    if (is_absent(a, ain)) {
        a->n.bad_mux++;
        return 0.0;
    }
    return a->io.ain_v(a->io.ctx, ain, t_ns);
}

static inline bool is_out_of_range(const struct ads1256 *a, double v)
{
    return v < -BEYOND_V || v > a->cfg.avdd_v + BEYOND_V;
}

static double source_ohm(const struct ads1256 *a, unsigned select, int64_t t_ns)
{
    if (!a->io.source_ohm || is_absent(a, ain_of(select))) return 0.0;
    return a->io.source_ohm(a->io.ctx, ain_of(select), t_ns);
}

static double buffer_v(struct ads1256 *a, double v)
{
    const double max_v = a->cfg.avdd_v - ADS1256_AVDD_LESS_V;
    if (v >= 0.0 && v <= max_v) return v;
    a->n.buffer_clipped++;
    return v < 0.0 ? 0.0 : max_v;
}

/* Two sources, their resistances and the three impedances of the switched input, which scale with 1/fCLKIN. */
static double loaded_v(const struct ads1256 *a, double p_v, double p_ohm, double n_v, double n_ohm)
{
    const double scale = NOMINAL_HZ / a->cfg.clkin_hz * 1e3;
    const unsigned g = ads1256_pga_log2(a);
    const double pin_s = 1.0 / (load[g].pin_kohm * scale);
    const double between_s = 1.0 / (load[g].between_kohm * scale);
    const double mid_a = 0.5 * a->cfg.avdd_v * pin_s;
    const double pr = fmin(p_ohm, OPEN_OHM);
    const double nr = fmin(n_ohm, OPEN_OHM);
    const double pp = 1.0 + pr * (pin_s + between_s);
    const double nn = 1.0 + nr * (pin_s + between_s);
    const double pv = p_v + pr * mid_a;
    const double nv = n_v + nr * mid_a;
    const double vp = pv * nn + pr * between_s * nv;
    const double vn = nv * pp + nr * between_s * pv;
    return (vp - vn) / (pp * nn - pr * nr * between_s * between_s);
}

double ads1256_input_v(struct ads1256 *a, int64_t t_ns)
{
    const unsigned p = ads1256_value(a, ADS1256_MUX) >> 4;
    const unsigned n = ads1256_value(a, ADS1256_MUX) & 15;
    const double p_v = open_v(a, p, t_ns);
    const double n_v = open_v(a, n, t_ns);
    if (is_out_of_range(a, p_v) || is_out_of_range(a, n_v)) a->n.range_exceeded++;
    const unsigned detect = (ads1256_value(a, ADS1256_ADCON) & ADS1256_ADCON_SDCS) >> 3;
    if (detect) {
        /* The current flows out of AINP and into AINN, and the buffer is on, whatever BUFEN says (SBAS288 p. 15); an open
         * input goes to the end of its range. */
        const double drop_v = detect_a[detect] * (source_ohm(a, p, t_ns) + RMUX_OHM);
        const double rise_v = detect_a[detect] * (source_ohm(a, n, t_ns) + RMUX_OHM);
        return buffer_v(a, p_v + drop_v) - buffer_v(a, n_v - rise_v);
    }
    if (ads1256_value(a, ADS1256_STATUS) & ADS1256_STATUS_BUFEN) return buffer_v(a, p_v) - buffer_v(a, n_v);
    return a->io.source_ohm ? loaded_v(a, p_v, source_ohm(a, p, t_ns), n_v, source_ohm(a, n, t_ns)) : p_v - n_v;
}
