#include "board/gyro/board.h"

#include "base/detmath.h"
#include "board/gyro/gyro.h"
#include "gen/gyro_od.h"
#include "gen/psabench_can.h"

#include <math.h>
#include <stddef.h>

enum { XY_COB = 0x180 };
#define PI             3.141592653589793238
#define RATE_LSB_RADPS (RAD_PER_DEG / 3600.0 * 1e-4)
#define ANGLE_LSB_RAD  (PI / 2147483648.0)
#define LEVEL_LSB_RAD  (RAD_PER_DEG * 2e-6)

/* ---- readings ---- */

/* Rounded, and limited to what so many bits hold. */
static int32_t to_lsb(double value, double step, unsigned bits)
{
    const double top = (double)((INT64_C(1) << (bits - 1)) - 1);
    return (int32_t)floor(fmin(fmax(value / step, -top - 1.0), top) + 0.5);
}

static struct psabench_gyro_rates_t rates_of(const struct gyro_reading *r)
{
    return (struct psabench_gyro_rates_t){to_lsb(r->u1_radps, RATE_LSB_RADPS, 32),
                                          to_lsb(r->u2_radps, RATE_LSB_RADPS, 32)};
}

static struct psabench_gyro_angles_t angles_of(const struct gyro_reading *r)
{
    return (struct psabench_gyro_angles_t){
        .encoder = to_lsb(r->encoder_rad, ANGLE_LSB_RAD, 32),
        .step = (uint16_t)r->step,
        .mode = (uint8_t)r->mode,
        .phase = (uint8_t)r->phase,
        .position = (uint8_t)r->position,
        .saturated = (r->flags & GYRO_SATURATED) != 0,
        .level_lost = (r->flags & GYRO_LEVEL_LOST) != 0,
        .encoder_fault = (r->flags & GYRO_ENCODER_FAULT) != 0,
        .not_settled = (r->flags & GYRO_NOT_SETTLED) != 0,
    };
}

static struct psabench_gyro_level_t level_of(const struct gyro_reading *r)
{
    return (struct psabench_gyro_level_t){to_lsb(r->beta_rad, LEVEL_LSB_RAD, 24),
                                          to_lsb(r->gamma_rad, LEVEL_LSB_RAD, 24), r->level_seq};
}

static void on_reading(void *ctx, const struct gyro_reading *r, int64_t t_ns)
{
    struct gyro_can *c = ctx;
    struct can_msg m[GYRO_TPDOS] = {{0}, {0}, {0}};
    const struct psabench_gyro_rates_t rates = rates_of(r);
    const struct psabench_gyro_angles_t angles = angles_of(r);
    const struct psabench_gyro_level_t level = level_of(r);
    m[0].len = (uint8_t)psabench_gyro_rates_pack(m[0].data, &rates, sizeof m[0].data);
    m[1].len = (uint8_t)psabench_gyro_angles_pack(m[1].data, &angles, sizeof m[1].data);
    m[2].len = (uint8_t)psabench_gyro_level_pack(m[2].data, &level, sizeof m[2].data);
    board_node_stream(&c->node, GYRO_RATES_TPDO, m, GYRO_TPDOS, t_ns);
}

static void on_condition(void *ctx, enum gyro_flag what, bool active, int64_t t_ns)
{
    static const struct {
        enum gyro_flag what;
        uint16_t code;
        uint8_t source;
    } rows[] = {{GYRO_LEVEL_LOST, GYRO_EMCY_LEVEL_LOST, 1},
                {GYRO_ENCODER_FAULT, GYRO_EMCY_ENCODER_FAULT, 2},
                {GYRO_NOT_SETTLED, GYRO_EMCY_NOT_SETTLED, 4},
                {GYRO_SATURATED, GYRO_EMCY_SATURATED, 4}};
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (rows[i].what == what) board_node_condition(ctx, rows[i].code, rows[i].source, active, t_ns);
    }
}

/* ---- the level unit ---- */

static void on_level_frame(struct board_node *n, const struct can_msg *m, int64_t t_ns)
{
    const struct gyro_can *c = (const struct gyro_can *)n;
    struct psabench_psa2_xy_t xy;
    if (m->id != c->level_id || c->level_id == 0) return;
    if (psabench_psa2_xy_unpack(&xy, m->data, m->len) == 0) gyro_take_level(n->board, xy.x, xy.y, xy.seq, t_ns);
}

/* ---- objects ---- */

static const struct gyro *gyro_of(const struct board_node *n)
{
    return n->board;
}

/* Where settings are; those of a run only change between runs. */
struct row {
    uint16_t index;
    uint8_t sub, count; /* sub-indices in a row, doubles in a row */
    bool between_runs, not_zero;
    size_t offset;
};
#define SET(m) offsetof(struct gyro_settings, m)
static const struct row rows[] = {
    {GYRO_OD_SLEW, 1, 6, false, false, SET(slew_deg)},          {GYRO_OD_RUN, 1, 5, true, false, SET(count)},
    {GYRO_OD_POSITIONS, 1, 32, true, false, SET(position_deg)}, {GYRO_OD_LOOPS, 1, 2, false, false, SET(m1_per_s)},
    {GYRO_OD_PLACE, 1, 3, false, false, SET(latitude_deg)},     {GYRO_OD_HEADING, 1, 1, false, false, SET(azimuth_deg)},
    {GYRO_OD_DRIFT, 1, 2, false, false, SET(drift1_degph)},     {GYRO_OD_LEVEL, 2, 2, false, false, SET(zero_x_v)},
    {GYRO_OD_LEVEL, 4, 2, false, true, SET(scale_x_v_per_g)},
};

static const struct row *row_of(const struct co_entry *e)
{
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        if (rows[i].index == e->index && e->sub >= rows[i].sub && e->sub < rows[i].sub + rows[i].count) return &rows[i];
    }
    return NULL;
}

static double *value_of(struct gyro_settings *set, const struct row *r, uint8_t sub)
{
    return (double *)(void *)((char *)set + r->offset) + (sub - r->sub);
}

static double read_setting(const struct board_node *n, const struct co_entry *e)
{
    struct gyro *b = n->board;
    const struct row *r = row_of(e);
    if (r) return *value_of(&b->set, r, e->sub);
    if (e->index == GYRO_OD_HEADING) return gyro_heading_deg(b);
    return b->base.cfg.level_node;
}

static uint32_t reject_setting(struct board_node *n, uint32_t abort, const char *why)
{
    ((struct gyro *)n->board)->counters.refused++;
    board_node_reject(n, why);
    return abort;
}

static uint32_t write_setting(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct gyro *b = n->board;
    const struct row *r = row_of(e);
    (void)t_ns;
    if (!r) return CO_AB_READ_ONLY;
    if (r->between_runs && gyro_running(b)) return reject_setting(n, CO_AB_STATE, "a run is under way");
    if (r->not_zero && v->number == 0.0)
        return reject_setting(n, CO_AB_VALUE, "the scale of a level sensor cannot be 0");
    *value_of(&b->set, r, e->sub) = v->number;
    gyro_settings_changed(b);
    return CO_OK;
}

static double read_control(const struct board_node *n, const struct co_entry *e)
{
    const struct gyro *b = gyro_of(n);
    const double value[] = {0.0, b->run.mode, b->run.phase, b->run.position, b->latest.flags};
    return value[e->sub];
}

/* why: NULL, or why the controller does not. */
static uint32_t answer_to(struct board_node *n, const char *why)
{
    if (why) board_node_reject(n, why);
    return why ? CO_AB_STATE : CO_OK;
}

static uint32_t write_mode(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    return answer_to(n, gyro_set_mode(n->board, (enum gyro_mode)v->number, t_ns));
}

/* As the messages have it. */
static double read_latest(const struct board_node *n, const struct co_entry *e)
{
    const struct gyro_reading *r = &gyro_of(n)->latest;
    const struct psabench_gyro_rates_t u = rates_of(r);
    const struct psabench_gyro_level_t l = level_of(r);
    const unsigned state = (unsigned)r->mode | (unsigned)r->phase << 3 | r->position << 5 | r->flags << 12;
    const double value[] = {0.0,   u.u1,   u.u2,    angles_of(r).encoder, (uint16_t)r->step,
                            state, l.beta, l.gamma, l.level_seq};
    return value[e->sub];
}

static double read_clock(const struct board_node *n, const struct co_entry *e)
{
    const struct gyro *b = gyro_of(n);
    const double value[] = {0.0, b->profile.step_ns, b->number};
    return value[e->sub];
}

static double read_magnetic(const struct board_node *n, const struct co_entry *e)
{
    const struct gyro_reading *r = &gyro_of(n)->latest;
    const double deg = r->magnetic_rad / RAD_PER_DEG;
    const double value[] = {0.0, r->magnetic, deg < 0.0 ? deg + 360.0 : deg};
    return value[e->sub];
}

static double read_past(const struct board_node *n, const struct co_entry *e)
{
    const struct gyro_past *past = gyro_of(n)->past;
    const unsigned i = e->sub - 1U;
    return i < GYRO_FLAGS ? past[i].begun : past[i - GYRO_FLAGS].step;
}

static double read_self_test(const struct board_node *n, const struct co_entry *e)
{
    const struct gyro_nod *nod = &gyro_of(n)->nod;
    return e->sub == 1 ? nod->way != GYRO_NOD_NONE : nod->result;
}

static uint32_t begin_self_test(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    (void)e;
    return answer_to(n, v->number != 0.0 ? gyro_self_test(n->board, t_ns) : NULL);
}

static const struct board_object objects[] = {
    {GYRO_OD_CONTROL, .value = read_control, .write = write_mode},
    {GYRO_OD_SLEW, .value = read_setting, .write = write_setting},
    {GYRO_OD_RUN, .value = read_setting, .write = write_setting},
    {GYRO_OD_POSITIONS, .value = read_setting, .write = write_setting},
    {GYRO_OD_LOOPS, .value = read_setting, .write = write_setting},
    {GYRO_OD_PLACE, .value = read_setting, .write = write_setting},
    {GYRO_OD_HEADING, .value = read_setting, .write = write_setting},
    {GYRO_OD_DRIFT, .value = read_setting, .write = write_setting},
    {GYRO_OD_LEVEL, .value = read_setting, .write = write_setting},
    {GYRO_OD_CLOCK, .value = read_clock},
    {GYRO_OD_PAST, .value = read_past},
    {GYRO_OD_SELF_TEST, .value = read_self_test, .write = begin_self_test},
    {GYRO_OD_MAGNETIC, .value = read_magnetic},
    {GYRO_OD_LATEST, .value = read_latest},
};

static int64_t period_ns(const void *board)
{
    return ((const struct gyro *)board)->profile.step_ns;
}

static const struct board_node_type type = {
    .device = &gyro_device, BOARD_NODE_OBJECTS(objects), .period_ns = period_ns, .rx_other = on_level_frame};

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    struct gyro_can *c = can;
    struct gyro *b = (struct gyro *)board;
    board_node_init(can, &type, cfg, board, bus, s);
    c->level_id = b->base.cfg.level_node ? (uint32_t)XY_COB + b->base.cfg.level_node : 0;
    b->host = (struct gyro_host){.ctx = can, .reading = on_reading, .condition = on_condition};
}

const struct board_can gyro_can = {.size = sizeof(struct gyro_can), .init = init_can, BOARD_NODE_LIFE};
