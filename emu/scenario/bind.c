/* From the keys to the bench: what a scenario leaves to the seed is drawn here. */
#include "base/detmath.h"
#include "scenario/keys.h"

#include <string.h>

static double clamp_value(double v, double lo, double hi)
{
    return v < lo ? lo : v > hi ? hi : v;
}

/* Each parameter has its own stream: one more in the table does not shift the others. */
static void draw_parameters(const struct fields *t, const void *deviation, void *value, const struct scenario *s,
                            uint32_t serial, const char *channel)
{
    size_t offset;
    const struct field *d;
    for (size_t i = 0; (d = yaml_row(t, i, &offset)); i++) {
        char stream[80];
        double sd, v;
        memcpy(&sd, (const char *)deviation + offset + d->offset, sizeof sd);
        memcpy(&v, (const char *)value + offset + d->offset, sizeof v);
        if (!(sd > 0.0)) continue;
        snprintf(stream, sizeof stream, "passport.%s.%s", channel, d->key);
        struct rng r = rng_stream(s->seed, serial, stream);
        v = clamp_value(v + sd * rng_gauss(&r), d->min, d->max);
        memcpy((char *)value + offset + d->offset, &v, sizeof v);
    }
}

/* A sensor of the batch, with the hinge of its own pendulum. */
static void draw_quartz(const struct scenario *s, uint32_t serial, unsigned axis, struct unit_axis_cfg *c)
{
    c->quartz = quartz_with_pendulum(&c->quartz, s->lab.site.g_mps2);
    (void)quartz_batch_draw(&s->spread.quartz, s->seed, serial, axis,
                            &c->quartz); /* its groups were tried at loading */
}

static void draw_unit(const struct scenario *s, struct scenario_unit *u)
{
    static const char *const sensor[] = {"x", "y", "z"}, *const chain[] = {"x.afe", "y.afe", "z.afe"};
    static const char *const gyro[] = {"x.gyro", "y.gyro", "z.gyro"};
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        const uint32_t serial = u->cfg.board.serial;
        draw_parameters(&scenario_mems_fields, &s->spread.mems, &u->cfg.axis[i].mems, s, serial, sensor[i]);
        draw_parameters(&scenario_cvg_fields, &s->spread.cvg, &u->cfg.axis[i].cvg, s, serial, gyro[i]);
        draw_parameters(&scenario_afe_numbers, &s->spread.afe, &u->cfg.board.afe[i], s, serial, chain[i]);
        if (s->spread.quartz_given && u->cfg.axis[i].sensor == UNIT_QUARTZ) draw_quartz(s, serial, i, &u->cfg.axis[i]);
    }
    if (s->spread.quartz_given) u->cfg.batch = &s->spread.quartz;
}

void scenario_bind(struct scenario *s)
{
    s->lab.site = scenario_site(&s->site);
    for (unsigned i = 0; i < s->unit_count; i++) {
        struct scenario_unit *u = &s->units[i];
        u->cfg.name = u->name;
        u->cfg.profile = &u->profile;
        u->cfg.board.seed = s->seed;
        for (unsigned k = 0; k < 3; k++)
            u->cfg.mounting.misalignment_rad[k] = u->misalignment_arcsec[k] * RAD_PER_ARCSEC;
        scenario_bind_level(s, u);
        if (u->spread) draw_unit(s, u);
    }
}
