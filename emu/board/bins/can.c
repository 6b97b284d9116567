#include "board/bins/board.h"

#include "base/detmath.h"
#include "gen/bins_od.h"
#include "gen/psabench_can.h"

#include <math.h>

enum { FRAMES = 5, NAV_FRAMES = 4, SOURCE_ACCEL_PORT = 1, SOURCE_TEMP_PORT = 2 };
#define NM_PER_M       1e9
#define UAS_PER_ARCSEC 1e6

static const struct bins *bins_of(const struct board_node *n)
{
    return n->board;
}

/* ---- readings ---- */

static uint32_t tstamp_us(const struct bins_reading *r)
{
    return (uint32_t)((r->t_ns + 500) / 1000);
}

static struct psabench_bins_gyro_z_t gyro_z_of(const struct bins_reading *r)
{
    return (struct psabench_bins_gyro_z_t){
        .gz = r->gyro[2],
        .seq = (uint16_t)r->seq,
        .words = r->words,
        .settled = (r->flags & BINS_SETTLED) != 0,
        .clip = (r->flags & BINS_CLIP) != 0,
        .incomplete = (r->flags & BINS_INCOMPLETE) != 0,
        .stretched = (r->flags & BINS_STRETCHED) != 0,
        .temp_new = (r->flags & BINS_TEMP_NEW) != 0,
    };
}

static void end_conditions(struct board_node *n, const struct bins_reading *r, int64_t t_ns)
{
    co_node_error_end(&n->node, BINS_EMCY_ACCEL_PORT, t_ns);
    if (r->flags & BINS_TEMP_NEW) co_node_error_end(&n->node, BINS_EMCY_TEMP_PORT, t_ns);
}

static void on_reading(void *ctx, const struct bins_reading *r, int64_t t_ns)
{
    struct board_node *n = ctx;
    struct can_msg m[FRAMES] = {{0}, {0}, {0}, {0}, {0}};
    const struct psabench_bins_gyro_xy_t gyro_xy = {r->gyro[0], r->gyro[1]};
    const struct psabench_bins_gyro_z_t gyro_z = gyro_z_of(r);
    const struct psabench_bins_accel_xy_t accel_xy = {r->accel[0], r->accel[1]};
    const struct psabench_bins_accel_z_t accel_z = {r->accel[2], tstamp_us(r)};
    const struct psabench_bins_baro_t baro = {r->baro_mm};
    m[0].len = (uint8_t)psabench_bins_gyro_xy_pack(m[0].data, &gyro_xy, sizeof m[0].data);
    m[1].len = (uint8_t)psabench_bins_gyro_z_pack(m[1].data, &gyro_z, sizeof m[1].data);
    m[2].len = (uint8_t)psabench_bins_accel_xy_pack(m[2].data, &accel_xy, sizeof m[2].data);
    m[3].len = (uint8_t)psabench_bins_accel_z_pack(m[3].data, &accel_z, sizeof m[3].data);
    m[4].len = (uint8_t)psabench_bins_baro_pack(m[4].data, &baro, sizeof m[4].data);
    end_conditions(n, r, t_ns);
    board_node_stream(n, BINS_GYRO_XY_TPDO, m, FRAMES, t_ns);
}

/* ---- the unit's own navigation ---- */

static double limited_to(double x, double limit)
{
    return fmin(fmax(floor(x + 0.5), -limit), limit - 1.0);
}

/* The messages' fields, in the order of object 2210h. */
static void nav_fields(const struct bins *b, double field[BINS_NAV_FIELDS])
{
    const struct bins_nav *n = &b->nav;
    double w_radps[3];
    bins_nav_rates(n, w_radps);
    field[0] = limited_to(n->lat_rad / RAD_PER_DEG * 1e7, 2147483648.0);
    field[1] = limited_to(n->lon_rad / RAD_PER_DEG * 1e7, 2147483648.0);
    for (unsigned i = 0; i < 2; i++) field[2 + i] = limited_to(n->v_mps[i] * 1e4, 8388608.0);
    field[4] = (uint16_t)(n->since / n->every + 1);
    for (unsigned i = 0; i < 4; i++) field[5 + i] = limited_to(n->q[i] * 32768.0, 32768.0);
    for (unsigned i = 0; i < 3; i++) field[9 + i] = limited_to(w_radps[i] / RAD_PER_DEG / 0.004, 32768.0);
    field[12] = (uint16_t)((n->t_ns + 500000) / 1000000);
}

static void on_navigated(void *ctx, int64_t t_ns)
{
    struct board_node *n = ctx;
    struct bins_can *can = ctx;
    double *f = can->nav;
    nav_fields(bins_of(n), f);
    struct can_msg m[NAV_FRAMES] = {{0}, {0}, {0}, {0}};
    const struct psabench_bins_nav_place_t place = {(int32_t)f[0], (int32_t)f[1]};
    const struct psabench_bins_nav_speed_t speed = {(int32_t)f[2], (int32_t)f[3], (uint16_t)f[4]};
    const struct psabench_bins_nav_turn_t turn = {(int16_t)f[5], (int16_t)f[6], (int16_t)f[7], (int16_t)f[8]};
    const struct psabench_bins_nav_rate_t rate = {(int16_t)f[9], (int16_t)f[10], (int16_t)f[11], (uint16_t)f[12]};
    m[0].len = (uint8_t)psabench_bins_nav_place_pack(m[0].data, &place, sizeof m[0].data);
    m[1].len = (uint8_t)psabench_bins_nav_speed_pack(m[1].data, &speed, sizeof m[1].data);
    m[2].len = (uint8_t)psabench_bins_nav_turn_pack(m[2].data, &turn, sizeof m[2].data);
    m[3].len = (uint8_t)psabench_bins_nav_rate_pack(m[3].data, &rate, sizeof m[3].data);
    board_node_stream(n, BINS_NAV_PLACE_TPDO, m, NAV_FRAMES, t_ns);
}

static void on_fault(void *ctx, uint16_t code, int64_t t_ns)
{
    const bool accel = code == PSA2_FAULT_ACCEL_PORT;
    board_node_condition(ctx, accel ? BINS_EMCY_ACCEL_PORT : BINS_EMCY_TEMP_PORT,
                         accel ? SOURCE_ACCEL_PORT : SOURCE_TEMP_PORT, true, t_ns);
}

/* ---- objects ---- */

static double read_increments(const struct board_node *n, const struct co_entry *e)
{
    const struct bins_reading *r = &bins_of(n)->latest;
    return e->sub <= 3 ? r->gyro[e->sub - 1] : r->accel[e->sub - 4];
}

static double read_head(const struct board_node *n, const struct co_entry *e)
{
    const struct bins_reading *r = &bins_of(n)->latest;
    const uint32_t value[] = {0, (uint16_t)r->seq, r->words, r->flags, tstamp_us(r)};
    return value[e->sub];
}

static double read_temperature(const struct board_node *n, const struct co_entry *e)
{
    return bins_of(n)->temp_code[e->sub - 1];
}

static double read_weight(const struct board_node *n, const struct co_entry *e)
{
    const struct bins *b = bins_of(n);
    return e->sub == 1 ? floor(b->profile.gyro_arcsec_per_count * UAS_PER_ARCSEC + 0.5)
                       : bins_accel_mps_per_code(b) * NM_PER_M;
}

static double read_timing(const struct board_node *n, const struct co_entry *e)
{
    const struct bins *b = bins_of(n);
    const int64_t value[] = {0, b->profile.words_per_reading, bins_word_ns(b), ads1282_delay_ns(&b->psa2.adc[0]),
                             bins_accel_age_ns(b)};
    return (double)value[e->sub];
}

static double read_baro(const struct board_node *n, const struct co_entry *e)
{
    (void)e;
    return bins_of(n)->latest.baro_mm;
}

static double read_nav(const struct board_node *n, const struct co_entry *e)
{
    return ((const struct bins_can *)(const void *)n)->nav[e->sub - 1];
}

static double read_nav_mode(const struct board_node *n, const struct co_entry *e)
{
    const enum bins_nav_state state = bins_of(n)->nav.state;
    return e->sub == 1 ? state == BINS_NAV_ALIGNING || state == BINS_NAV_RUNNING : state;
}

static uint32_t write_nav_mode(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    struct bins *b = n->board;
    (void)e;
    (void)t_ns;
    if (v->number != 0.0 && b->latest.seq == 0) {
        board_node_reject(n, "no reading has come yet");
        return CO_AB_STATE;
    }
    if (v->number != 0.0)
        bins_nav_start(&b->nav, &b->latest, b->profile.nav_every, b->profile.gyro_arcsec_per_count * RAD_PER_ARCSEC,
                       bins_accel_mps_per_code(b));
    else bins_nav_stop(&b->nav);
    return CO_OK;
}

/* Member and unit of each sub-index of 2212h. */
static double *nav_setting(struct bins_nav_settings *set, uint8_t sub, double *unit)
{
    const double units[] = {1e-7 * RAD_PER_DEG, 1e-7 * RAD_PER_DEG, 1e-3, 1.0};
    double *const members[] = {&set->lat_rad, &set->lon_rad, &set->h_m, &set->alignment_s};
    *unit = units[sub - 1];
    return members[sub - 1];
}

static double read_nav_start(const struct board_node *n, const struct co_entry *e)
{
    struct bins_nav_settings set = bins_of(n)->nav.set;
    double unit;
    const double *member = nav_setting(&set, e->sub, &unit);
    return floor(*member / unit + 0.5);
}

static uint32_t write_nav_start(struct board_node *n, const struct co_entry *e, const struct co_value *v, int64_t t_ns)
{
    double unit;
    (void)t_ns;
    double *member = nav_setting(&((struct bins *)n->board)->nav.set, e->sub, &unit);
    *member = v->number * unit;
    return CO_OK;
}

static const struct board_object objects[] = {
    {BINS_OD_INCREMENTS, .value = read_increments},
    {BINS_OD_READING, .value = read_head},
    {BINS_OD_TEMPERATURES, .value = read_temperature},
    {BINS_OD_WEIGHTS, .value = read_weight},
    {BINS_OD_TIMING, .value = read_timing},
    {BINS_OD_BARO, .value = read_baro},
    {BINS_OD_NAV, .value = read_nav},
    {BINS_OD_NAV_MODE, .value = read_nav_mode, .write = write_nav_mode},
    {BINS_OD_NAV_START, .value = read_nav_start, .write = write_nav_start},
};

static int64_t period_ns(const void *board)
{
    return bins_period_ns(&((const struct bins *)board)->profile);
}

static const struct board_node_type type = {
    .device = &bins_device, BOARD_NODE_OBJECTS(objects), .period_ns = period_ns};

static void init_can(void *can, const struct board_can_cfg *cfg, struct board *board, struct can_bus *bus,
                     struct sched *s)
{
    board_node_init(can, &type, cfg, board, bus, s);
    ((struct bins *)board)->host =
        (struct bins_host){.ctx = can, .reading = on_reading, .navigated = on_navigated, .fault = on_fault};
}

const struct board_can bins_can = {.size = sizeof(struct bins_can), .init = init_can, BOARD_NODE_LIFE};
