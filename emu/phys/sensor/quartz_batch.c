#include "phys/sensor/quartz_batch.h"

#include "base/detmath.h"

#include <math.h>
#include <stdio.h>

enum { TRIES = 1000 };

struct quartz_batch quartz_batch_default(void)
{
    return (struct quartz_batch){
        .name = "default",
        .share_a = 0.45,
        .share_b = 0.40,
        .curve_min_ug = 120.0,
        .curve_max_ug = 500.0,
        .centre_min_degc = 5.0,
        .centre_max_degc = 18.0,
        .width_min_k = 52.0,
        .width_max_k = 62.0,
        .slope_ug_per_k = 0.25,
        .rest_slope_min_ug_per_k = 1.0,
        .rest_slope_max_ug_per_k = 8.0,
        .zero_min_ug = 40.0,
        .zero_max_ug = 150.0,
        .ratio_min = 3.0,
        .ratio_max = 16.0,
        .scale_tc_ppm_per_k = 20.0,
        .scale_curve_ppm = 100.0,
        .base_slope_arcsec_per_k = 0.02,
        .base_curve_arcsec = 3.0,
        .position_urad = 2.0,
        .glue_ug = 60.0,
        .glue_ppm = 60.0,
        .glue_arcsec = 12.0,
        .glue_spread = 0.5,
        .glue_correlation = 0.6,
        .glue_keep = 0.5,
        .glue_keep_spread = 0.15,
        .start_ug = 12.6,
        .start_ppm = 18.7,
        .start_arcsec = 1.64,
        .zero_tolerance_ug = 50.0,
        .scale_tolerance_ppm = 60.0,
        .base_tolerance_arcsec = 10.0,
    };
}

enum quartz_group quartz_group(const struct quartz_g *g)
{
    return g->curve_ug > 0.0 ? QUARTZ_GROUP_A : g->curve_ug < 0.0 ? QUARTZ_GROUP_B : QUARTZ_REST;
}

const char *quartz_group_name(enum quartz_group group)
{
    static const char *const names[QUARTZ_GROUPS] = {"a", "b", "rest"};
    return names[group];
}

double quartz_ratio(const struct quartz_g *g)
{
    double most = 0.0;
    for (int t = QUARTZ_COLD_DEGC; t <= QUARTZ_HOT_DEGC; t++) most = fmax(most, fabs(quartz_settled_ug(g, t)));
    return most / fabs(quartz_settled_ug(g, QUARTZ_REFERENCE_DEGC));
}

/* ---- draws: one source for each parameter of each sensor, one number for each try */

struct lot {
    uint64_t seed;
    uint32_t serial;
    unsigned axis;
    int64_t number;
};

static struct draws source_of(const struct lot *l, const char *what)
{
    char name[64];
    snprintf(name, sizeof name, "passport.quartz.%c.%s", "xyz"[l->axis], what);
    return draws_of(l->seed, l->serial, name);
}

static double draw_share(const struct lot *l, const char *what)
{
    const struct draws d = source_of(l, what);
    return (double)(draws_u64(&d, l->number) >> 11) * 0x1p-53;
}

static double draw_between(const struct lot *l, const char *what, double least, double most)
{
    return least + (most - least) * draw_share(l, what);
}

static double draw_normal(const struct lot *l, const char *what, double sd)
{
    const struct draws d = source_of(l, what);
    return sd * draws_gauss(&d, l->number);
}

/* size, or its negative */
static double draw_sign(const struct lot *l, const char *what, double size)
{
    return draw_share(l, what) < 0.5 ? size : -size;
}

/* ---- the parameters */

static enum quartz_group draw_group(const struct quartz_batch *b, const struct lot *l)
{
    const double at = draw_share(l, "group");
    return at < b->share_a ? QUARTZ_GROUP_A : at < b->share_a + b->share_b ? QUARTZ_GROUP_B : QUARTZ_REST;
}

static void draw_bias(const struct quartz_batch *b, const struct lot *l, enum quartz_group group, struct quartz_g *g)
{
    const double curve_ug = draw_between(l, "curve", b->curve_min_ug, b->curve_max_ug);
    const double line = draw_between(l, "rest_slope", b->rest_slope_min_ug_per_k, b->rest_slope_max_ug_per_k);
    const double zero_ug = draw_between(l, "zero", b->zero_min_ug, b->zero_max_ug);
    g->curve_ug = group == QUARTZ_GROUP_A ? curve_ug : group == QUARTZ_GROUP_B ? -curve_ug : 0.0;
    g->curve_centre_degc = draw_between(l, "centre", b->centre_min_degc, b->centre_max_degc);
    g->curve_width_k = draw_between(l, "width", b->width_min_k, b->width_max_k);
    g->slope_ug_per_k =
        group == QUARTZ_REST ? draw_sign(l, "rest_slope_sign", line) : draw_normal(l, "slope", b->slope_ug_per_k);
    g->position_urad = draw_normal(l, "position", b->position_urad);
    g->zero_ug = 0.0;
    g->zero_ug = draw_sign(l, "zero_sign", zero_ug) - quartz_settled_ug(g, QUARTZ_REFERENCE_DEGC);
}

static void draw_scale_and_base(const struct quartz_batch *b, const struct lot *l, struct quartz_g *g)
{
    g->scale_tc_ppm_per_k = draw_normal(l, "scale_tc", b->scale_tc_ppm_per_k);
    g->scale_curve_ppm = draw_normal(l, "scale_curve", b->scale_curve_ppm);
    g->base_slope_arcsec_per_k = draw_normal(l, "base_slope", b->base_slope_arcsec_per_k);
    g->base_curve_arcsec = draw_normal(l, "base_curve", b->base_curve_arcsec);
}

/* Log-normal of this mean; its logarithm shares a part with the other two. */
static double draw_stress(const struct quartz_batch *b, const struct lot *l, const char *what, double mean)
{
    char sign[32];
    const double shared = fmin(fmax(b->glue_correlation, 0.0), 1.0);
    const double z = draw_normal(l, "glue", sqrt(shared)) + draw_normal(l, what, sqrt(1.0 - shared));
    snprintf(sign, sizeof sign, "%s_sign", what);
    return draw_sign(l, sign, mean * det_exp(b->glue_spread * (z - 0.5 * b->glue_spread)));
}

static void draw_causes(const struct quartz_batch *b, const struct lot *l, struct quartz_g *g)
{
    g->glue_ug = draw_stress(b, l, "glue_zero", b->glue_ug);
    g->glue_ppm = draw_stress(b, l, "glue_scale", b->glue_ppm);
    g->glue_arcsec = draw_stress(b, l, "glue_base", b->glue_arcsec);
    g->glue_keep = fmin(b->glue_keep * det_exp(draw_normal(l, "glue_keep", b->glue_keep_spread)), 1.0);
    g->start_ug = b->start_ug;
    g->start_ppm = b->start_ppm;
    g->start_arcsec = b->start_arcsec;
}

bool quartz_batch_draw(const struct quartz_batch *b, uint64_t seed, uint32_t serial, unsigned axis, struct quartz_g *g)
{
    struct lot l = {seed, serial, axis, 0};
    const enum quartz_group group = draw_group(b, &l);
    draw_scale_and_base(b, &l, g);
    draw_causes(b, &l, g);
    for (; l.number < TRIES; l.number++) {
        draw_bias(b, &l, group, g);
        const double ratio = quartz_ratio(g);
        if (ratio >= b->ratio_min && ratio <= b->ratio_max) return true;
    }
    return false;
}
