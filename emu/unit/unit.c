#include "unit/unit.h"

#include "unit/surroundings.h"

#include "base/detmath.h"
#include "canopen/co_node.h"

#include <stdio.h>
#include <string.h>

const char *const unit_mounts[] = {[LAB_HEAD] = "head",         [LAB_TABLE] = "table",   [LAB_FIXED] = "fixed",
                                   [LAB_PLATFORM] = "platform", [LAB_FLIGHT] = "flight", NULL};

/* In the chamber the board is as warm as the case, the thermometers of the sensors as their elements. */
static double temp_degc(void *ctx, unsigned channel, int64_t t_ns)
{
    const struct unit *u = ctx;
    const struct chamber *c = &u->lab->chamber;
    if (channel >= UNIT_TEMPS) return 0.0;
    if (!c->cfg.present) return u->cfg.temp_degc[channel];
    return channel < UNIT_AXES ? chamber_element_degc(c, &u->body, t_ns) : chamber_case_degc(c, &u->body, t_ns);
}

#define WARM_STEP_NS INT64_C(10000000) /* 10 mK at most in a chamber of 60 K/min, without any lag */

static bool is_quartz(const struct unit *u, unsigned axis)
{
    return u->cfg.axis[axis].sensor == UNIT_QUARTZ;
}

static bool is_gyro(const struct unit *u, unsigned axis)
{
    return u->cfg.axis[axis].sensor == UNIT_CVG;
}

/* Without a chamber nothing changes, and not every MEMS feels it. */
static bool feels_steps(const struct unit *u, unsigned axis)
{
    const struct mems_cfg *m = &u->mems[axis].cfg;
    return is_quartz(u, axis) || m->u0_tc_v_per_k != 0.0 || m->k_tc_per_k != 0.0;
}

/* What a chamber does to a quartz sensor beyond its element. Without one its case is as warm as that, and nothing moves. */
static void warm_quartz(struct unit *u, unsigned axis, int64_t t_ns)
{
    struct quartz *q = &u->quartz[axis];
    const struct chamber *c = &u->lab->chamber;
    if (!c->cfg.present) {
        q->case_degc = q->felt_degc = q->element_degc;
        return;
    }
    q->case_degc = chamber_case_degc(c, &u->body, t_ns);
    q->felt_degc = chamber_felt_degc(c, &u->body, &u->play[axis], t_ns);
    q->cycles = chamber_body_cycles(c, &u->body, t_ns);
}

/* Temperature of the sensor's element, as of the latest whole step, however often it is read. */
static void warm_sensor(struct unit *u, unsigned axis, int64_t t_ns)
{
    const int64_t step = t_ns / WARM_STEP_NS;
    if (step == u->warm_step[axis]) return;
    u->warm_step[axis] = step;
    const double element_degc = temp_degc(u, axis, step * WARM_STEP_NS);
    u->mems[axis].temp_degc = u->quartz[axis].element_degc = u->cvg[axis].temp_degc = element_degc;
    if (is_quartz(u, axis)) warm_quartz(u, axis, step * WARM_STEP_NS);
}

/* What the sensor of a channel measures at a row of instants, a = -f on its own axes: at rest the projections of gravity. The face
 * turns the sensor's own axes; which of the unit's axes they are follows from its channel. The sensor is where it is in the
 * unit: at_m stays in the case's axes. Returns how many are written: 1 if the first holds for all. */
static unsigned feel_row_mps2(struct unit *u, unsigned axis, const struct looks *at, double a_mps2[][3])
{
    const struct lab_sensor s = {&u->cfg.mounting, u->cfg.axis[axis].at_m, u->cos_alpha0[axis], u->sin_alpha0[axis]};
    const unsigned felt = lab_sensor_row_mps2(u->lab, &s, at->t_ns, at->n, a_mps2);
    for (unsigned i = 0; axis != 0 && i < felt; i++) {
        const double a[3] = {a_mps2[i][0], a_mps2[i][1], a_mps2[i][2]};
        for (unsigned k = 0; k < 3; k++) a_mps2[i][k] = a[(k + axis) % 3];
    }
    return felt;
}

static void put_out_row(struct unit *u, unsigned axis, const double *a_mps2, unsigned felt, const struct looks *at,
                        double *out)
{
    if (is_quartz(u, axis)) quartz_out_row_a(&u->quartz[axis], a_mps2, felt, at, out);
    else mems_out_row_v(&u->mems[axis], a_mps2, felt, at, out);
}

/* How many of the looks from the first on are of one step of temperature. */
static unsigned same_step(const struct looks *at)
{
    const int64_t end_ns = (at->t_ns[0] / WARM_STEP_NS + 1) * WARM_STEP_NS;
    unsigned n = at->n;
    while (at->t_ns[n - 1] >= end_ns) n--;
    return n;
}

/* Outputs of a sensor that feels a_mps2: of one temperature at a time. */
static void sense_row(struct unit *u, unsigned axis, const double *a_mps2, unsigned felt, const struct looks *at,
                      double *out)
{
    if (!feels_steps(u, axis)) {
        put_out_row(u, axis, a_mps2, felt, at, out);
        return;
    }
    for (struct looks rest = *at; rest.n > 0;) {
        const unsigned n = same_step(&rest), from = at->n - rest.n;
        warm_sensor(u, axis, rest.t_ns[0]);
        put_out_row(u, axis, felt == 1 ? a_mps2 : a_mps2 + 3 * from, felt == 1 ? 1 : n,
                    &(struct looks){rest.t_ns, n, at->every_ns}, out + from);
        rest.t_ns += n;
        rest.n -= n;
    }
}

/* Inertial rate and a = -f on the axes of a channel's sensor. */
static void feel_motion(struct unit *u, unsigned axis, int64_t t_ns, double w_radps[3], double a_mps2[3])
{
    struct kinematics kin;
    lab_kinematics(u->lab, &u->cfg.mounting, u->cfg.axis[axis].at_m, t_ns, &kin);
    for (unsigned k = 0; k < 3; k++) {
        w_radps[k] = kin.w_radps[(k + axis) % 3];
        a_mps2[k] = -kin.f_mps2[(k + axis) % 3];
    }
}

static void gyro_row(struct unit *u, unsigned axis, const struct looks *at, double *out)
{
    double w_radps[3], a_mps2[3];
    for (unsigned i = 0; i < at->n; i++) {
        feel_motion(u, axis, at->t_ns[i], w_radps, a_mps2);
        warm_sensor(u, axis, at->t_ns[i]);
        out[i] = cvg_out_v(&u->cvg[axis], w_radps, a_mps2, at->t_ns[i], at->every_ns);
    }
}

static void accel_row(void *ctx, unsigned axis, const struct looks *at, double *out)
{
    struct unit *u = ctx;
    double a_mps2[LOOKS_MAX][3];
    if (u->cfg.axis[axis].sensor == UNIT_NO_SENSOR) {
        for (unsigned i = 0; i < at->n; i++) out[i] = 0.0;
        return;
    }
    if (is_gyro(u, axis)) {
        gyro_row(u, axis, at, out);
    } else {
        const unsigned felt = feel_row_mps2(u, axis, at, a_mps2);
        sense_row(u, axis, a_mps2[0], felt, at, out);
    }
    sensor_fault_row(u->sensor_faults[axis], at, out);
}

/* One look where a series is in place of the lab; one that has ended is no sensor. */
static void recorded_look(struct unit *u, unsigned axis, const struct looks *at, double *out)
{
    double value;
    if (!series_value(&u->cfg.axis[axis].series, at->t_ns[0], &value)) {
        *out = 0.0;
        return;
    }
    *out = value;
    if (u->cfg.axis[axis].sensor != UNIT_RECORDED) sense_row(u, axis, (const double[3]){-value, 0.0, 0.0}, 1, at, out);
    sensor_fault_row(u->sensor_faults[axis], at, out);
}

static void recorded_row(void *ctx, unsigned axis, const struct looks *at, double *out)
{
    struct unit *u = ctx;
    if (!u->cfg.axis[axis].series.sample) {
        accel_row(ctx, axis, at, out);
        return;
    }
    for (unsigned i = 0; i < at->n; i++)
        recorded_look(u, axis, &(struct looks){&at->t_ns[i], 1, at->every_ns}, &out[i]);
}

/* It feels gravity alone, turned this way and that; what tables, vehicles and a head's turns on a lever arm add has no bound. */
static bool feels_gravity(const struct unit *u, unsigned axis)
{
    const enum lab_mount on = u->cfg.mounting.on;
    return on == LAB_FIXED || (on == LAB_HEAD && lab_is_centred(&u->cfg.mounting, u->cfg.axis[axis].at_m));
}

#define ROUNDED 1.001 /* turns leave a vector's length as it is, but for the last bits */

/* A sensor whose output follows from the instant, or from looks not long ago. */
static struct looks_range accel_range(void *ctx, unsigned axis, int64_t every_ns, int64_t until_ns, const char **why)
{
    const struct unit *u = ctx;
    const struct unit_axis_cfg *c = &u->cfg.axis[axis];
    const double a_max_mps2 = ROUNDED * u->lab->site.g_mps2;
    if (c->sensor == UNIT_NO_SENSOR) return (struct looks_range){0.0, 0.0};
    if (c->series.sample) *why = "a sensor is driven from a file";
    else if (is_quartz(u, axis) && quartz_past_ns(&u->quartz[axis]) < 0)
        *why = "the loop of a quartz sensor remembers long";
    else if (u->sensor_faults[axis]) *why = "a sensor has a fault";
    else if (is_gyro(u, axis)) *why = "a sensor is a gyro";
    else if (!is_quartz(u, axis) && u->mems[axis].slow.moves) *why = "a sensor has slow noise";
    else if (!feels_gravity(u, axis)) *why = "its mount accelerates it";
    if (is_quartz(u, axis)) return quartz_range_a(&u->quartz[axis], a_max_mps2, every_ns);
    return mems_range_v(&u->mems[axis], a_max_mps2, every_ns, until_ns);
}

static int64_t accel_past_ns(void *ctx, unsigned axis)
{
    const struct unit *u = ctx;
    return is_quartz(u, axis) ? ns_later(quartz_past_ns(&u->quartz[axis]), 0) : 0;
}

static void skip_accel(void *ctx, unsigned axis, int64_t t_ns)
{
    struct unit *u = ctx;
    if (is_quartz(u, axis)) quartz_skip(&u->quartz[axis], t_ns);
}

static bool is_recorded(const struct unit *u)
{
    bool any = false;
    for (unsigned i = 0; i < UNIT_AXES; i++) any |= u->cfg.axis[i].series.sample != NULL;
    return any;
}

/* An observer may end its own or another's subscription: the cursor lives in the unit, where unit_unsubscribe() sees it. */
static void on_event(void *ctx, unsigned event, int64_t t_ns)
{
    struct unit *u = ctx;
    u->next_observer = u->observers;
    while (u->next_observer) {
        struct unit_observer *l = u->next_observer;
        u->next_observer = l->next;
        l->fn(l->ctx, event, t_ns);
    }
}

void unit_subscribe(struct unit *u, struct unit_observer *l)
{
    struct unit_observer **at = &u->observers;
    while (*at) at = &(*at)->next;
    l->next = NULL;
    *at = l;
    board_observe(u->board, true);
}

void unit_unsubscribe(struct unit *u, struct unit_observer *l)
{
    struct unit_observer **at = &u->observers;
    while (*at && *at != l) at = &(*at)->next;
    if (!*at) return;
    if (u->next_observer == l) u->next_observer = l->next;
    *at = l->next;
    l->next = NULL;
    if (!u->observers) board_observe(u->board, false);
}

struct unit_cfg unit_default(const char *name)
{
    static const struct board_cfg quiet = {.adc_noise_scale = 1.0, .temp_noise_scale = 1.0, .seed = 1, .serial = 1};
    struct unit_cfg c = {.name = name, .board = quiet, .temp_degc = {25.0, 25.0, 25.0, 25.0}};
    for (unsigned i = 0; i < UNIT_AXES; i++) c.axis[i].quartz = quartz_default();
    unit_cfg_type(&c, board_types[0]);
    return c;
}

void unit_cfg_type(struct unit_cfg *cfg, const struct board_type *type)
{
    cfg->type = type;
    cfg->profile = NULL;
    cfg->node = type->node;
    for (unsigned i = 0; i < UNIT_AXES; i++) cfg->board.afe[i] = afe_nominal(AFE_VOLTAGE);
    if (type->cfg_default) type->cfg_default(&cfg->board);
}

/* A copy of its own for the board; its name stays here. */
static void init_board(struct unit *u, struct sched *s)
{
    struct board_io io = {.ctx = u, .accel = accel_row, .temp_degc = temp_degc, .event = on_event};
    io.accel_range = accel_range;
    io.accel_past_ns = accel_past_ns;
    io.skip_accel = skip_accel;
    if (is_recorded(u)) io.accel = recorded_row;
    unit_put_surroundings(u, &io);
    union board_profile_store defaults;
    const void *profile = u->cfg.profile;
    if (!profile) {
        fields_default(u->type->fields, &defaults);
        profile = &defaults;
    }
    snprintf(u->profile, sizeof u->profile, "%s", board_profile_name(u->type, profile));
    u->type->init(u->board, profile, &u->cfg.board, &io, s);
    u->board->type = u->type;
}

/* Draws are keyed by the sensor's own number, so that it has the same noise and the same starts on any board. */
static void init_quartz(struct unit *u, unsigned axis)
{
    static const char *const noise[UNIT_AXES] = {"quartz.x", "quartz.y", "quartz.z"};
    static const char *const scatter[UNIT_AXES] = {"quartz.start.x", "quartz.start.y", "quartz.start.z"};
    const uint64_t seed = u->cfg.board.seed;
    quartz_init(&u->quartz[axis], &u->cfg.axis[axis].quartz, u->lab->site.g_mps2,
                draws_of(seed, u->sensors_serial, noise[axis]), draws_of(seed, u->sensors_serial, scatter[axis]));
}

static void init_gyro(struct unit *u, unsigned axis)
{
    static const char *const noise[UNIT_AXES] = {"cvg.x", "cvg.y", "cvg.z"};
    static const char *const slow_noise[UNIT_AXES] = {"cvg.slow.x", "cvg.slow.y", "cvg.slow.z"};
    const struct board_cfg *of = &u->cfg.board;
    cvg_init(&u->cvg[axis], &u->cfg.axis[axis].cvg, u->lab->site.g_mps2, draws_of(of->seed, of->serial, noise[axis]),
             draws_of(of->seed, of->serial, slow_noise[axis]));
}

static void init_mems(struct unit *u, unsigned axis, const struct mems_cfg *m)
{
    static const char *const noise[UNIT_AXES] = {"mems.x", "mems.y", "mems.z"};
    static const char *const slow_noise[UNIT_AXES] = {"mems.slow.x", "mems.slow.y", "mems.slow.z"};
    const struct board_cfg *of = &u->cfg.board;
    mems_init(&u->mems[axis], m, draws_of(of->seed, of->serial, noise[axis]),
              draws_of(of->seed, of->serial, slow_noise[axis]));
}

/* A unit with accelerometers of its own has them where the bench puts no other sensor. */
static void fit_own_accelerometers(struct unit *u)
{
    for (unsigned i = 0; u->type->accelerometer && i < UNIT_AXES; i++) {
        if (u->cfg.axis[i].sensor != UNIT_NO_SENSOR) continue;
        u->cfg.axis[i].sensor = UNIT_MEMS;
        u->type->accelerometer(u->board, i, u->lab->site.g_mps2, &u->cfg.axis[i].mems);
        const struct mems_cfg m = mems_cfg_si(&u->cfg.axis[i].mems, u->lab->site.g_mps2);
        init_mems(u, i, &m);
    }
}

void unit_init(struct unit *u, const struct unit_cfg *cfg, struct lab *lab, struct sched *s)
{
    u->cfg = *cfg;
    u->lab = lab;
    u->type = cfg->type;
    u->board = (struct board *)&u->store;
    u->can = NULL;
    u->on = false;
    u->sensors_serial = cfg->board.serial;
    u->observers = u->next_observer = NULL;
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        u->sensor_faults[i] = NULL;
        u->warm_step[i] = -1;
        const struct mems_cfg m = mems_cfg_si(&cfg->axis[i].mems, lab->site.g_mps2);
        init_mems(u, i, &m);
        init_quartz(u, i);
        init_gyro(u, i);
        const bool quartz = cfg->axis[i].sensor == UNIT_QUARTZ;
        const double alpha0_rad = quartz ? cfg->axis[i].quartz.alpha0_deg * RAD_PER_DEG : m.alpha0_rad;
        const struct det_pair alpha0 = det_sin_cos(alpha0_rad);
        u->cos_alpha0[i] = alpha0.cos;
        u->sin_alpha0[i] = alpha0.sin;
    }
    chamber_put_in(&lab->chamber, &u->body, cfg->tau_case_s, cfg->tau_element_s);
    for (unsigned i = 0; i < UNIT_AXES; i++)
        if (is_quartz(u, i)) chamber_play_add(&u->body, &u->play[i], cfg->axis[i].quartz.play_k);
    init_board(u, s);
    fit_own_accelerometers(u);
}

void unit_connect(struct unit *u, const struct board_can_cfg *cfg, struct can_bus *bus, struct sched *s)
{
    struct board_can_cfg typed = *cfg;
    typed.type = u->type;
    u->can = &u->can_store;
    u->type->can->init(u->can, &typed, u->board, bus, s);
}

void unit_power_up(struct unit *u, int64_t t_ns)
{
    u->on = true;
    for (unsigned i = 0; i < UNIT_AXES; i++) quartz_start(&u->quartz[i]);
    u->type->power_up(u->board, t_ns);
    if (u->can) u->type->can->power_up(u->can, t_ns);
}

void unit_power_down(struct unit *u, int64_t t_ns)
{
    u->on = false;
    u->type->power_down(u->board, t_ns);
    if (u->can) u->type->can->power_down(u->can);
}

void unit_sample_until(struct unit *u, int64_t t_ns)
{
    u->type->sample_until(u->board, t_ns);
}

/* Slow noise goes on where no one looks, in a unit without power, too: up to t_ns it is that of the old seed. */
void unit_reseed(struct unit *u, uint64_t seed, int64_t t_ns)
{
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        (void)noise_slow_u(&u->mems[i].slow, t_ns);
        draws_reseed(&u->mems[i].noise, seed);
        draws_reseed(&u->mems[i].slow.draws, seed);
        quartz_reseed(&u->quartz[i], seed);
        (void)noise_slow_u(&u->cvg[i].slow, t_ns);
        draws_reseed(&u->cvg[i].noise, seed);
        draws_reseed(&u->cvg[i].slow.draws, seed);
    }
    board_reseed(u->board, seed);
}

/* Why sensors cannot be exchanged; NULL: they can. */
static const char *why_kept(const struct unit *u, int64_t t_ns)
{
    bool any = false;
    if (!u->cfg.batch) return "its sensors are of no batch: expected spread: true, and quartz in the scenario's spread";
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        any |= is_quartz(u, i);
        if (u->sensor_faults[i]) return "one of its sensors has a fault; clear it first";
    }
    if (!any) return "it has no quartz sensor";
    if (u->lab->chamber.cfg.present && !chamber_stable(&u->lab->chamber, t_ns))
        return "the chamber is on its way to its set point";
    return NULL;
}

bool unit_exchange_sensors(struct unit *u, uint32_t serial, int64_t t_ns, const char **why)
{
    *why = why_kept(u, t_ns);
    if (*why) return false;
    u->sensors_serial = serial;
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        if (!is_quartz(u, i)) continue;
        (void)quartz_batch_draw(u->cfg.batch, u->cfg.board.seed, serial, i, &u->cfg.axis[i].quartz);
        init_quartz(u, i);
        u->warm_step[i] = -1;
        if (u->on) quartz_start(&u->quartz[i]);
    }
    if (u->lab->chamber.cfg.present) chamber_renew(&u->lab->chamber, &u->body, t_ns);
    return true;
}

const char *unit_why_eager(struct unit *u, int64_t t_ns)
{
    if (u->board->sched->eager) return "--eager";
    return u->type->why_eager ? u->type->why_eager(u->board, t_ns) : "a board of this type always does";
}

struct trace *unit_trace(const struct unit *u)
{
    return &u->board->trace;
}

struct co_node *unit_co(const struct unit *u)
{
    return u->can ? u->type->can->node(u->can) : NULL;
}

struct can_node *unit_node(const struct unit *u)
{
    return u->can ? &unit_co(u)->stream : NULL;
}

static double gyro_true_v(struct unit *u, unsigned axis, int64_t t_ns)
{
    double w_radps[3], a_mps2[3];
    feel_motion(u, axis, t_ns, w_radps, a_mps2);
    warm_sensor(u, axis, t_ns);
    return cvg_true_v(&u->cvg[axis], w_radps, a_mps2);
}

double unit_sensor_out(struct unit *u, unsigned axis, int64_t t_ns)
{
    const enum unit_sensor sensor = u->cfg.axis[axis].sensor;
    struct series *s = &u->cfg.axis[axis].series;
    double a_mps2[3] = {0.0, 0.0, 0.0}, value = 0.0;
    if (sensor == UNIT_NO_SENSOR || (s->sample && !series_value(s, t_ns, &value))) return 0.0;
    if (sensor == UNIT_RECORDED) return value;
    if (is_gyro(u, axis)) return gyro_true_v(u, axis, t_ns);
    if (s->sample) a_mps2[0] = -value;
    else (void)feel_row_mps2(u, axis, &(struct looks){&t_ns, 1, 0}, &a_mps2);
    if (feels_steps(u, axis)) warm_sensor(u, axis, t_ns);
    if (is_quartz(u, axis)) return quartz_true_a(&u->quartz[axis], a_mps2);
    return mems_true_v(&u->mems[axis], a_mps2, t_ns);
}

double unit_zero_moved_v(const struct unit *u, unsigned axis, int64_t t_ns)
{
    if (is_gyro(u, axis)) return cvg_zero_moved_v(&u->cvg[axis], t_ns);
    return u->cfg.axis[axis].sensor == UNIT_MEMS ? mems_zero_moved_v(&u->mems[axis], t_ns) : 0.0;
}
