/* Two inertial units on buses of their own, the same script of readings, SDO requests to objects 2210h to 2212h, and time; settings
 * are written to one of them while it navigates, too. Both navigate alike: settings are taken when the mode is written. An
 * answer is what the dictionary and the unit's state say, and navigation stays finite, on the ellipsoid and in its states. */
#include "fuzz.h"

#include "base/bits.h"
#include "base/detmath.h"
#include "board/bins/board.h"
#include "gen/bins_od.h"

#include <math.h>
#include <string.h>

enum { NODE = 11, STEPS_MAX = 200, READINGS_MAX = 4000, BURST = 100, ANSWER_NS = 2000000, SUBS = 4 };
#define PERIOD_NS INT64_C(10000000)

struct world {
    struct sched s;
    struct can_bus bus;
    struct bins b;
    struct bins_can can;
    struct can_node host;
    bool answered;
    uint8_t answer[8];
    int64_t set[SUBS]; /* 2212h, as it was written */
    unsigned readings;
};

struct request {
    uint16_t index;
    uint8_t sub, size; /* 0: a read */
    uint32_t value;
};

/* ---- the bench: nothing moves and the PSA-2 has no power, since readings come from the script */

static void kinematics(void *ctx, int64_t t_ns, double f_mps2[3], double w_radps[3])
{
    (void)ctx;
    (void)t_ns;
    for (unsigned i = 0; i < 3; i++) f_mps2[i] = w_radps[i] = 0.0;
}

static void accel(void *ctx, unsigned axis, const struct looks *at, double *out)
{
    (void)ctx;
    (void)axis;
    (void)at;
    (void)out;
    assert(false);
}

static double degc(void *ctx, unsigned channel, int64_t t_ns)
{
    (void)ctx;
    (void)channel;
    (void)t_ns;
    return 25.0;
}

static int64_t smooth_ns(void *ctx, int64_t t_ns)
{
    (void)ctx;
    (void)t_ns;
    return INT64_MAX;
}

static void hear(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct world *w = ctx;
    assert(can_valid(m) && t_ns <= w->s.now_ns);
    if (m->id != 0x580 + NODE) return;
    assert(!w->answered && m->len == 8);
    memcpy(w->answer, m->data, sizeof w->answer);
    w->answered = true;
}

static void begin(struct world *w)
{
    const struct board_io io = {
        .ctx = w, .accel = accel, .temp_degc = degc, .kinematics = kinematics, .smooth_ns = smooth_ns};
    const struct board_cfg cfg = {.seed = 3, .serial = 4};
    const struct board_can_cfg can = {.name = "sins", .type = &bins_board, .node_id = NODE};
    struct bins_profile p;
    memset(w, 0, sizeof *w);
    sched_init(&w->s);
    can_bus_init(&w->bus, &(struct can_bus_cfg){.bitrate_hz = 1000000}, &w->s);
    fields_default(&bins_fields, &p);
    bins_init(&w->b, &p, &cfg, &io, &w->s);
    bins_can.init(&w->can, &can, &w->b.psa2.base, &w->bus, &w->s);
    w->host = (struct can_node){.name = "host", .rx = hear, .ctx = w};
    can_attach(&w->bus, &w->host);
    bins_can.power_up(&w->can, 0);
    w->set[3] = (int64_t)BINS_ALIGNMENT_S;
    sched_run_until(&w->s, 10 * ANSWER_NS);
}

/* ---- what holds after each step */

static void check(const struct world *w)
{
    const struct bins_nav *n = &w->b.nav;
    assert(n->state <= BINS_NAV_FAILED);
    if (n->state != BINS_NAV_RUNNING) return;
    double size2 = 0.0;
    for (unsigned i = 0; i < 4; i++) size2 += n->q[i] * n->q[i];
    assert(fabs(size2 - 1.0) < 1e-12);
    assert(fabs(n->lat_rad) <= 89.0 * RAD_PER_DEG && fabs(n->lon_rad) <= 180.0000001 * RAD_PER_DEG);
    assert(isfinite(n->v_mps[0]) && isfinite(n->v_mps[1]));
    for (unsigned i = 0; i < 3; i++) assert(isfinite(n->turned_rad[i]));
}

static bool same_reals(const double *a, const double *b, unsigned n)
{
    bool same = true;
    for (unsigned i = 0; i < n; i++) same = same && a[i] == b[i];
    return same;
}

static void check_twins(const struct world *a, const struct world *b)
{
    const struct bins_nav *p = &a->b.nav, *q = &b->b.nav;
    assert(p->state == q->state && p->time_s == q->time_s && p->since == q->since);
    assert(p->lat_rad == q->lat_rad && p->lon_rad == q->lon_rad);
    assert(same_reals(p->v_mps, q->v_mps, 2) && same_reals(p->q, q->q, 4));
    assert(same_reals(a->can.nav, b->can.nav, BINS_NAV_FIELDS));
}

/* ---- requests */

static bool may_set(uint8_t sub, uint8_t size, uint32_t value)
{
    static const int64_t low[SUBS] = {-800000000, -1800000000, -500000, 1};
    static const int64_t high[SUBS] = {800000000, 1800000000, 20000000, 7200};
    if (sub < 1 || sub > SUBS || size != (sub == SUBS ? 2 : 4)) return false;
    const int64_t v = sub == SUBS ? (int64_t)value : (int64_t)(int32_t)value;
    return v >= low[sub - 1] && v <= high[sub - 1];
}

static bool may_write(const struct world *w, const struct request *r)
{
    if (r->index == BINS_OD_NAV_START) return may_set(r->sub, r->size, r->value);
    const bool mode = r->index == BINS_OD_NAV_MODE && r->sub == 1 && r->size == 1 && r->value <= 1;
    return mode && (r->value == 0 || w->b.latest.seq > 0);
}

static void call(struct world *w, const struct request *r)
{
    struct can_msg m = {.id = 0x600 + NODE, .len = 8};
    m.data[0] = (uint8_t)(r->size ? 0x23u | (4u - r->size) << 2 : 0x40u);
    m.data[1] = (uint8_t)r->index;
    m.data[2] = (uint8_t)(r->index >> 8);
    m.data[3] = r->sub;
    for (unsigned i = 0; i < 4; i++) m.data[4 + i] = (uint8_t)(r->value >> (8 * i));
    w->answered = false;
    if (can_send(&w->bus, &w->host, &m, w->s.now_ns) != CAN_OK) assert(false);
    sched_run_until(&w->s, w->s.now_ns + ANSWER_NS);
    assert(w->answered && memcmp(w->answer + 1, m.data + 1, 3) == 0);
}

static void write_object(struct world *w, const struct request *r)
{
    const bool may = may_write(w, r);
    call(w, r);
    assert((w->answer[0] == 0x60) == may && (may || w->answer[0] == 0x80));
    if (!may) return;
    if (r->index == BINS_OD_NAV_START) w->set[r->sub - 1] = r->sub == SUBS ? (int64_t)r->value : (int32_t)r->value;
    else assert(w->b.nav.state == (r->value ? BINS_NAV_ALIGNING : BINS_NAV_OFF));
}

static bool is_active(const struct world *w)
{
    return w->b.nav.state == BINS_NAV_ALIGNING || w->b.nav.state == BINS_NAV_RUNNING;
}

/* What an object should show, as it comes in an expedited answer. */
static bool shown_by(const struct world *w, const struct request *r, double *value)
{
    if (r->index == BINS_OD_NAV && r->sub >= 1 && r->sub <= BINS_NAV_FIELDS) *value = w->can.nav[r->sub - 1];
    else if (r->index == BINS_OD_NAV_START && r->sub >= 1 && r->sub <= SUBS) *value = (double)w->set[r->sub - 1];
    else if (r->index == BINS_OD_NAV_MODE && r->sub == 1) *value = is_active(w);
    else if (r->index == BINS_OD_NAV_MODE && r->sub == 2) *value = w->b.nav.state;
    else return false;
    return true;
}

static void read_object(struct world *w, const struct request *r)
{
    double due;
    const bool has = shown_by(w, r, &due);
    call(w, r);
    assert(r->sub == 0 || (w->answer[0] == 0x80) == !has);
    if (!has || w->answer[0] == 0x80) return;
    const unsigned size = 4u - (w->answer[0] >> 2 & 3u);
    const uint64_t mask = (UINT64_C(1) << (8 * size)) - 1;
    assert((w->answer[0] & ~0x0Cu) == 0x43u);
    assert(((uint64_t)bits_get_le(w->answer + 4, size) & mask) == ((uint64_t)(int64_t)due & mask));
}

/* ---- readings */

/* As the computer hands them out. */
static void hand_out(struct world *w, const int32_t gyro[3], const int32_t accel[3], int64_t after_ns, uint8_t words)
{
    struct bins_reading *r = &w->b.latest;
    if (w->readings == READINGS_MAX) return;
    w->readings++;
    r->seq++;
    r->t_ns += after_ns;
    r->words = words;
    memcpy(r->gyro, gyro, sizeof r->gyro);
    memcpy(r->accel, accel, sizeof r->accel);
    w->b.host.reading(w->b.host.ctx, r, w->s.now_ns);
    const bool due = bins_nav_take(&w->b.nav, r);
    assert(!due || w->b.nav.state == BINS_NAV_RUNNING);
    if (due) {
        w->b.host.navigated(w->b.host.ctx, w->s.now_ns);
        bins_nav_shown(&w->b.nav);
    }
    sched_run_until(&w->s, w->s.now_ns + PERIOD_NS);
    check(w);
}

static void op_reading(struct world *w, struct script *s)
{
    const uint8_t how = script_byte(s), words = script_byte(s);
    int32_t gyro[3], accel[3];
    for (unsigned i = 0; i < 3; i++) gyro[i] = (int32_t)(uint32_t)script_uint(s, 4) >> (how & 31);
    for (unsigned i = 0; i < 3; i++) accel[i] = (int32_t)(uint32_t)script_uint(s, 4) >> (how & 31);
    hand_out(w, gyro, accel, PERIOD_NS * (1 + (how >> 5) * (how >> 5)), words);
}

/* A second at rest on the Earth: the axis that is up, and where north is. */
static void op_rest(struct world *w, struct script *s)
{
    const uint8_t how = script_byte(s);
    const unsigned up = how % 3u, north = (up + 1u + (how >> 2 & 1u)) % 3u;
    int32_t gyro[3] = {0, 0, 0}, accel[3] = {0, 0, 0};
    accel[up] = how & 8 ? -5000000 : 5000000; /* 1 g in 5 words of 9.7 um/s^2 */
    gyro[up] = (int8_t)script_byte(s) / 8;    /* 15 counts are the Earth's rate */
    gyro[north] = 1 + (how >> 4);
    for (unsigned i = 0; i < BURST; i++) hand_out(w, gyro, accel, PERIOD_NS, 5);
}

static void op_flight(struct world *w, struct script *s)
{
    int32_t gyro[3], accel[3];
    for (unsigned i = 0; i < 3; i++) gyro[i] = (int8_t)script_byte(s) * 1000;
    for (unsigned i = 0; i < 3; i++) accel[i] = (int8_t)script_byte(s) * 100000;
    for (unsigned i = 0; i < BURST; i++) hand_out(w, gyro, accel, PERIOD_NS, 5);
}

/* ---- the script */

static struct request request_of(struct script *s, bool write)
{
    static const uint16_t objects[] = {BINS_OD_NAV, BINS_OD_NAV_MODE, BINS_OD_NAV_START, BINS_OD_NAV_START};
    const uint8_t b = script_byte(s), how = script_byte(s);
    struct request r = {.index = objects[b & 3], .sub = b >> 2 & 15};
    if (!write) return r;
    r.size = 1 + (how & 3);
    r.value = (uint32_t)script_uint(s, r.size);
    if (how & 4) r.value = r.sub == SUBS ? 1 + r.value % 3 : (uint32_t)((int32_t)r.value / 4);
    return r;
}

/* Settings while it navigates go to the first alone; before the next start both have the same. */
static void op_write(struct world w[2], struct script *s)
{
    const struct request r = request_of(s, true);
    const bool alone = r.index == BINS_OD_NAV_START && is_active(&w[0]);
    if (r.index == BINS_OD_NAV_MODE) {
        w[1].b.nav.set = w[0].b.nav.set;
        memcpy(w[1].set, w[0].set, sizeof w[1].set);
    }
    write_object(&w[0], &r);
    if (!alone) write_object(&w[1], &r);
    else sched_run_until(&w[1].s, w[0].s.now_ns);
}

static void op_start(struct world w[2], struct script *s)
{
    const struct request set = {BINS_OD_NAV_START, SUBS, 2, 1 + script_byte(s) % 2},
                         start = {BINS_OD_NAV_MODE, 1, 1, 1};
    for (unsigned i = 0; i < 2; i++) write_object(&w[i], &set);
    w[1].b.nav.set = w[0].b.nav.set;
    memcpy(w[1].set, w[0].set, sizeof w[1].set);
    for (unsigned i = 0; i < 2; i++) write_object(&w[i], &start);
}

static void op_read(struct world w[2], struct script *s)
{
    const struct request r = request_of(s, false);
    for (unsigned i = 0; i < 2; i++) read_object(&w[i], &r);
}

static void both(struct world w[2], struct script *s, void (*op)(struct world *w, struct script *s))
{
    struct script again = *s;
    op(&w[0], &again);
    op(&w[1], s);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static void (*const alike[])(struct world * w, struct script * s) = {op_reading, op_rest, op_rest, op_flight};
    static void (*const asked[])(struct world w[2], struct script * s) = {op_write, op_write, op_read, op_start};
    static struct world w[2];
    struct script s = script_of(data, size);
    for (unsigned i = 0; i < 2; i++) begin(&w[i]);
    for (unsigned i = 0; i < STEPS_MAX && script_more(&s); i++) {
        const uint8_t b = script_byte(&s);
        if (b & 4) asked[b & 3](w, &s);
        else both(w, &s, alike[b & 3]);
        check_twins(&w[0], &w[1]);
    }
    return 0;
}
