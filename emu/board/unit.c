#include "board/unit.h"

#include "base/detmath.h"

#include <stddef.h>

#define RAD_PER_DEG 0.017453292519943295

/* In the chamber the board is as warm as the case, the thermometers of the sensors as their elements. */
static double temp_degc(void *ctx, unsigned channel, int64_t t_ns)
{
    const struct unit *u = ctx;
    const struct chamber *c = &u->lab->chamber;
    if (channel >= UNIT_TEMPS) return 0.0;
    if (!c->cfg.present) return u->cfg.temp_degc[channel];
    return channel < UNIT_AXES ? chamber_element_degc(c, &u->body, t_ns) : chamber_case_degc(c, &u->body, t_ns);
}

enum { WARM_STEP_NS = 10000000 }; /* 10 mK at most in a chamber of 60 K/min, without any lag */

/* Of the sensor's element, where the sensor minds it; as it was at the latest whole step, whoever looks how often. Without a
 * chamber a quartz's case is as warm as its element. */
static void warm(struct unit *u, unsigned axis, int64_t t_ns)
{
    struct mems *m = &u->mems[axis];
    struct quartz *q = &u->quartz[axis];
    const struct chamber *c = &u->lab->chamber;
    const bool quartz = u->cfg.axis[axis].sensor == UNIT_QUARTZ;
    const int64_t step = t_ns / WARM_STEP_NS;
    if (!quartz && m->cfg.u0_tc_v_per_k == 0.0 && m->cfg.k_tc_per_k == 0.0) return;
    if (step == u->warm_step[axis]) return;
    u->warm_step[axis] = step;
    const double element_degc = temp_degc(u, axis, step * WARM_STEP_NS);
    m->temp_degc = q->element_degc = element_degc;
    q->case_degc = c->cfg.present ? chamber_case_degc(c, &u->body, step * WARM_STEP_NS) : element_degc;
}

static double accel_signal(void *ctx, unsigned axis, int64_t t_ns)
{
    struct unit *u = ctx;
    if (u->cfg.axis[axis].sensor == UNIT_NO_SENSOR) return 0.0;
    double a_mps2[3];
    unit_gravity_mps2(u, axis, t_ns, a_mps2);
    warm(u, axis, t_ns);
    const double out = u->cfg.axis[axis].sensor == UNIT_QUARTZ ? quartz_out_a(&u->quartz[axis], a_mps2, t_ns)
                                                               : mems_out_v(&u->mems[axis], a_mps2, t_ns);
    return u->sensor_faults[axis] ? sensor_fault_out(u->sensor_faults[axis], out, t_ns) : out;
}

static void on_frame(void *ctx, const struct psa2_frame *f, int64_t t_ns)
{
    const struct unit *u = ctx;
    if (u->frame) u->frame(u->ctx, f, t_ns);
}

static void on_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    const struct unit *u = ctx;
    if (u->fault) u->fault(u->ctx, code, t_ns);
}

/* A listener may end its own or another's listening: the cursor lives in the unit, where unit_unlisten() sees it. */
static void on_event(void *ctx, enum psa2_event e, int64_t t_ns)
{
    struct unit *u = ctx;
    u->told_next = u->listeners;
    while (u->told_next) {
        struct unit_listener *l = u->told_next;
        u->told_next = l->next;
        l->fn(l->ctx, e, t_ns);
    }
}

void unit_listen(struct unit *u, struct unit_listener *l)
{
    struct unit_listener **at = &u->listeners;
    while (*at) at = &(*at)->next;
    l->next = NULL;
    *at = l;
    u->board.io.event = on_event;
}

void unit_unlisten(struct unit *u, struct unit_listener *l)
{
    struct unit_listener **at = &u->listeners;
    while (*at && *at != l) at = &(*at)->next;
    if (!*at) return;
    if (u->told_next == l) u->told_next = l->next;
    *at = l->next;
    l->next = NULL;
    if (!u->listeners) u->board.io.event = NULL;
}

struct unit_cfg unit_default(const char *name)
{
    static const struct psa2_unit_cfg quiet = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 1, .serial = 1};
    struct unit_cfg c = {.name = name, .board = quiet, .node = 5, .temp_degc = {25.0, 25.0, 25.0, 25.0}};
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        c.board.afe[i] = afe_nominal(AFE_VOLTAGE);
        c.axis[i].quartz = quartz_default();
    }
    return c;
}

void unit_init(struct unit *u, const struct unit_cfg *cfg, struct lab *lab, struct sched *s)
{
    static const char *const noise[UNIT_AXES] = {"mems.x", "mems.y", "mems.z"};
    static const char *const quartz_noise[UNIT_AXES] = {"quartz.x", "quartz.y", "quartz.z"};
    u->cfg = *cfg;
    u->lab = lab;
    u->ctx = NULL;
    u->frame = NULL;
    u->fault = NULL;
    u->listeners = u->told_next = NULL;
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        u->sensor_faults[i] = NULL;
        u->warm_step[i] = -1;
        const struct mems_cfg m = mems_cfg_si(&cfg->axis[i].mems, lab->site.g_mps2);
        mems_init(&u->mems[i], &m, rng_stream(cfg->board.seed, cfg->board.serial, noise[i]));
        quartz_init(&u->quartz[i], &cfg->axis[i].quartz, lab->site.g_mps2,
                    rng_stream(cfg->board.seed, cfg->board.serial, quartz_noise[i]));
        const bool quartz = cfg->axis[i].sensor == UNIT_QUARTZ;
        const double alpha0_rad = quartz ? cfg->axis[i].quartz.alpha0_deg * RAD_PER_DEG : m.alpha0_rad;
        u->cos_alpha0[i] = det_cos(alpha0_rad);
        u->sin_alpha0[i] = det_sin(alpha0_rad);
    }
    chamber_put_in(&lab->chamber, &u->body, cfg->tau_case_s, cfg->tau_element_s);
    const struct psa2_io io = {
        .ctx = u, .accel = accel_signal, .temp_degc = temp_degc, .frame = on_frame, .fault = on_fault};
    const struct psa2_profile profile = cfg->profile ? *cfg->profile : psa2_profile_default();
    psa2_init(&u->board, &profile, &cfg->board, &io, s);
}

/* The face turns the sensor's own axes; which of the unit's axes they are follows from its channel. The sensor is where it is
 * in the unit: at_m stays in the case's axes. */
void unit_gravity_mps2(struct unit *u, unsigned axis, int64_t t_ns, double a_mps2[3])
{
    double a[3];
    lab_sensor_mps2(u->lab, &u->cfg.seat, u->cfg.axis[axis].at_m, u->cos_alpha0[axis], u->sin_alpha0[axis], t_ns, a);
    for (unsigned i = 0; i < 3; i++) a_mps2[i] = a[(i + axis) % 3];
}

double unit_sensor_out(struct unit *u, unsigned axis, int64_t t_ns)
{
    if (u->cfg.axis[axis].sensor == UNIT_NO_SENSOR) return 0.0;
    double a_mps2[3];
    unit_gravity_mps2(u, axis, t_ns, a_mps2);
    warm(u, axis, t_ns);
    if (u->cfg.axis[axis].sensor == UNIT_QUARTZ) return quartz_true_a(&u->quartz[axis], a_mps2);
    return mems_true_v(&u->mems[axis], a_mps2, t_ns);
}
