/* What else the sub-block turns into codes: laser gyros, their rate sensors, temperatures, service signals. The article names
 * them and no more: scales, errors and registers are ours (E0). */
#include "board/psd1/internal.h"

#include "base/detmath.h"

#include <math.h>

#define WALK_POINTS  8u /* of the grid: the angle's random walk takes a step */
#define CODE12(code) ((uint16_t)((uint32_t)(code)&0xFFFu))

/* To the nearest code, clipped; halves away from zero. */
static int32_t code_of(double value, double per_code, int32_t low, int32_t high)
{
    const double x = value / per_code;
    if (!(x > low)) return low;
    if (x >= high) return high;
    return (int32_t)(x < 0.0 ? x - 0.5 : x + 0.5);
}

/* ---- laser gyros and rate sensors ---- */

static void read_rates(struct psd1 *b, int64_t t_ns, double w_radps[3])
{
    w_radps[0] = w_radps[1] = w_radps[2] = 0.0;
    if (b->base.io.rate_radps) b->base.io.rate_radps(b->base.io.ctx, t_ns, w_radps);
}

/* Angle of dt_s with the rate w at its end, by the trapezoid; after an abrupt change w holds all the way. */
static double angle_rad(const struct psd1_gyros *g, const struct psd1_gyro *a, double w_radps, double dt_s)
{
    return 0.5 * ((g->stale ? w_radps : a->w_radps) + w_radps) * dt_s;
}

static double measured_radps(const struct psd1_gyro *a, double w_radps)
{
    return a->scale * w_radps + a->bias_radps;
}

static double since_s(const struct psd1_gyros *g, int64_t t_ns)
{
    return 1e-9 * (double)(t_ns - g->t_ns);
}

static void integrate_to(struct psd1 *b, int64_t t_ns)
{
    struct psd1_gyros *g = &b->gyros;
    const double dt_s = since_s(g, t_ns);
    double w_radps[3];
    read_rates(b, t_ns, w_radps);
    for (unsigned i = 0; i < 3; i++) {
        struct psd1_gyro *a = &g->axis[i];
        const double w = measured_radps(a, w_radps[i]);
        a->angle_rad += angle_rad(g, a, w, dt_s);
        a->w_radps = w;
    }
    g->t_ns = t_ns;
    g->stale = false;
}

static void walk_step(struct psd1_gyros *g)
{
    for (unsigned i = 0; i < 3; i++)
        if (g->axis[i].arw_rad > 0.0)
            g->axis[i].angle_rad += g->axis[i].arw_rad * draws_gauss(&g->axis[i].noise, g->grid_ns);
}

/* Always at the points of the grid, independent of readers. */
static void integrate_gyros(struct psd1 *b, int64_t t_ns)
{
    struct psd1_gyros *g = &b->gyros;
    for (; g->grid_ns <= t_ns; g->grid_ns += b->profile.gyro_grid_ns) {
        integrate_to(b, g->grid_ns);
        if (++g->points % WALK_POINTS == 0) walk_step(g);
    }
}

static int64_t whole_below(double x)
{
    const int64_t whole = (int64_t)x; /* towards zero; floor() is a call */
    return whole - ((double)whole > x);
}

void psd1_aux_latch(struct psd1 *b, struct psd1_cycle *c, int64_t t_ns)
{
    const struct psd1_gyros *g = &b->gyros;
    const double count_rad = b->profile.gyro_arcsec_per_count * RAD_PER_ARCSEC;
    const double code_radps = b->profile.rate_dps_per_code * RAD_PER_DEG;
    double w_radps[3];
    integrate_gyros(b, t_ns);
    read_rates(b, t_ns, w_radps);
    const double dt_s = since_s(g, t_ns);
    for (unsigned i = 0; i < 3; i++) {
        const struct psd1_gyro *a = &g->axis[i];
        const double angle = a->angle_rad + angle_rad(g, a, measured_radps(a, w_radps[i]), dt_s);
        c->gyro[i] = (int32_t)(uint32_t)whole_below(angle / count_rad);
        c->rate[i] = (int16_t)code_of(w_radps[i] * a->rate_scale + a->rate_offset_radps, code_radps, -32768, 32767);
    }
}

void psd1_aux_until(struct psd1 *b, int64_t t_ns)
{
    if (b->phase == PSD1_OFF) return;
    integrate_gyros(b, t_ns);
    if (t_ns > b->gyros.t_ns) integrate_to(b, t_ns);
    b->gyros.stale = true;
}

void psd1_aux_power_up(struct psd1 *b, int64_t t_ns)
{
    struct psd1_gyros *g = &b->gyros;
    g->t_ns = t_ns;
    g->grid_ns = t_ns + b->profile.gyro_grid_ns;
    g->points = 0;
    g->stale = true;
    for (unsigned i = 0; i < 3; i++) g->axis[i].angle_rad = 0.0;
}

/* ---- temperatures and service signals: a channel above 12 bits of code ---- */

static uint16_t temp_code(const struct psd1 *b, unsigned channel, int64_t t_ns)
{
    const double t_degc = b->base.io.temp_degc(b->base.io.ctx, channel, t_ns) + b->temp_offset_k[channel];
    return CODE12(code_of(t_degc, b->profile.temp_k_per_code, -2048, 2047));
}

uint16_t psd1_aux_temp(const struct psd1 *b, int64_t t_ns)
{
    return (uint16_t)(b->temp_channel << 12 | temp_code(b, b->temp_channel, t_ns));
}

/* Bits: 0..2 the converter has given words, 3 coefficients are plausible, 4 the set-up has been carried out; A00h above. */
static uint16_t self_test(const struct psd1 *b)
{
    unsigned bits = 0xA00u | (b->ready ? 0x10u : 0u) | (b->coef_known ? 0x08u : 0u);
    for (unsigned i = 0; i < 3; i++) {
        if (b->adc[i].n.conversions) bits |= 1u << i;
        if (b->zero[i] == 0 || b->full[i] == 0 || b->zero[i] == 0xFFFFFF || b->full[i] == 0xFFFFFF) bits &= ~0x08u;
    }
    return (uint16_t)bits;
}

/* The bench's supply by way of a divider that makes the profile's voltage of its nominal one (E0). */
static double supply_v(const struct psd1 *b, int64_t t_ns)
{
    return b->base.io.supply_ratio ? b->supply_v * b->base.io.supply_ratio(b->base.io.ctx, t_ns) : b->supply_v;
}

uint16_t psd1_aux_service(const struct psd1 *b, int64_t t_ns)
{
    const struct psd1_profile *p = &b->profile;
    const double vref_v = p->adc_vref_v * b->vref_scale;
    const uint16_t code[4] = {
        CODE12(code_of(supply_v(b, t_ns), p->service_v_per_code, 0, 4095)),
        CODE12(code_of(vref_v, p->service_v_per_code, 0, 4095)),
        temp_code(b, 3, t_ns),
        self_test(b),
    };
    return (uint16_t)(b->service_channel << 12 | code[b->service_channel]);
}

/* ---- specimen ---- */

static void draw_gyro(const struct psd1 *b, struct psd1_gyro *g, const char *of, const char *noise)
{
    const struct psd1_profile *p = &b->profile;
    struct rng r = board_noise(&b->base, of);
    const double step_h = 1e-9 * WALK_POINTS * p->gyro_grid_ns / 3600.0;
    g->bias_radps = rng_gauss(&r) * p->gyro_bias_sd_degph * RAD_PER_DEG / 3600.0;
    g->scale = 1.0 + 1e-6 * rng_gauss(&r) * p->gyro_scale_sd_ppm;
    g->rate_offset_radps = rng_gauss(&r) * p->rate_offset_sd_dps * RAD_PER_DEG;
    g->rate_scale = 1.0 + 1e-6 * rng_gauss(&r) * p->rate_scale_sd_ppm;
    g->arw_rad = b->base.cfg.adc_noise_scale * p->gyro_arw_deg_rth * RAD_PER_DEG * sqrt(step_h);
    g->noise = board_draws(&b->base, noise);
}

void psd1_aux_init(struct psd1 *b)
{
    static const char *const of[] = {"psd1.gyro.x", "psd1.gyro.y", "psd1.gyro.z"};
    static const char *const noise[] = {"psd1.gyro.noise.x", "psd1.gyro.noise.y", "psd1.gyro.noise.z"};
    struct rng r = board_noise(&b->base, "psd1.service");
    for (unsigned i = 0; i < 3; i++) draw_gyro(b, &b->gyros.axis[i], of[i], noise[i]);
    for (unsigned i = 0; i < 4; i++) b->temp_offset_k[i] = rng_gauss(&r) * b->profile.temp_offset_sd_k;
    b->supply_v = b->profile.supply_v + rng_gauss(&r) * b->profile.supply_sd_v;
}
