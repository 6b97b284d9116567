#include "chip/ads1256_parts.h"

#include <math.h>

#define RMUX_OHM    25.0 /* of each side, SBAS288 p. 15 */
#define AVDD_LESS_V 2.0  /* range of the buffer, and the clamp of the sensor-detect current: 3 V of 5 */
#define BEYOND_V    0.1  /* range of the pins outside the supplies */
#define NOMINAL_HZ  7.68e6
#define OPEN_OHM    1e12

/* Effective impedance without buffer at 7.68 MHz, by log2 of the gain: of each pin to AVDD/2, and between the two.
 * SBAS288 p. 17, table 10. Both together are the 150 kohm / PGA of the electrical characteristics. */
static const struct {
    double pin_kohm, between_kohm;
} load[ADS1256_GAINS] = {{260, 220}, {130, 110}, {65, 55}, {33, 28}, {16, 14}, {8, 7}, {8, 7}};

static const double detect_ua[] = {0.0, 0.5, 2.0, 10.0};

/* One side of the multiplexer: voltage of the open circuit, resistance to the buffer or the PGA. */
struct side {
    double v, ohm;
};

static bool absent(const struct ads1256 *a, unsigned ain)
{
    return a->cfg.part == ADS1256_PART_1255 && ain > 1 && ain < ADS1256_AINCOM;
}

static struct side side_of(struct ads1256 *a, unsigned select, int64_t t_ns)
{
    const unsigned ain = select & 8 ? ADS1256_AINCOM : select;
    if (absent(a, ain)) { /* taken as AGND (E0): what floats there nobody knows */
        a->n.bad_mux++;
        return (struct side){0.0, 0.0};
    }
    return (struct side){
        .v = a->io.ain_v(a->io.ctx, ain, t_ns),
        .ohm = a->io.source_ohm ? a->io.source_ohm(a->io.ctx, ain, t_ns) : 0.0,
    };
}

static double buffered(struct ads1256 *a, double v)
{
    const double max_v = a->cfg.avdd_v - AVDD_LESS_V;
    if (v >= 0.0 && v <= max_v) return v;
    a->n.buffer_clipped++;
    return v < 0.0 ? 0.0 : max_v;
}

static void judge_range(struct ads1256 *a, double v)
{
    a->n.range_exceeded += v < -BEYOND_V || v > a->cfg.avdd_v + BEYOND_V;
}

/* The current flows out of AINP and into AINN; an open input goes to the end of its range. */
static double detected_v(struct ads1256 *a, struct side p, struct side n, double detect_a)
{
    return buffered(a, p.v + detect_a * (p.ohm + RMUX_OHM)) - buffered(a, n.v - detect_a * (n.ohm + RMUX_OHM));
}

/* Two sources and the three impedances of the switched input, which scale with 1/fCLKIN. */
static double loaded_v(const struct ads1256 *a, struct side p, struct side n)
{
    const double scale = NOMINAL_HZ / a->cfg.clkin_hz * 1e3;
    const unsigned g = ads1256_pga_log2(a);
    const double pin_s = 1.0 / (load[g].pin_kohm * scale);
    const double between_s = 1.0 / (load[g].between_kohm * scale);
    const double mid_a = 0.5 * a->cfg.avdd_v * pin_s;
    const double pr = fmin(p.ohm, OPEN_OHM);
    const double nr = fmin(n.ohm, OPEN_OHM);
    const double pp = 1.0 + pr * (pin_s + between_s);
    const double nn = 1.0 + nr * (pin_s + between_s);
    const double pv = p.v + pr * mid_a;
    const double nv = n.v + nr * mid_a;
    const double vp = pv * nn + pr * between_s * nv;
    const double vn = nv * pp + nr * between_s * pv;
    return (vp - vn) / (pp * nn - pr * nr * between_s * between_s);
}

double ads1256_input_v(struct ads1256 *a, int64_t t_ns)
{
    const uint8_t mux = ads1256_value(a, ADS1256_MUX);
    const struct side p = side_of(a, mux >> 4, t_ns);
    const struct side n = side_of(a, mux & 15, t_ns);
    judge_range(a, p.v);
    judge_range(a, n.v);
    /* The sensor-detect currents switch the buffer on, whatever BUFEN says (SBAS288 p. 15). */
    const double detect_ma = 1e-3 * detect_ua[(ads1256_value(a, ADS1256_ADCON) & ADS1256_ADCON_SDCS) >> 3];
    if (detect_ma > 0.0) return detected_v(a, p, n, 1e-3 * detect_ma);
    if (ads1256_value(a, ADS1256_STATUS) & ADS1256_STATUS_BUFEN) return buffered(a, p.v) - buffered(a, n.v);
    return a->io.source_ohm ? loaded_v(a, p, n) : p.v - n.v;
}
