/* Lazy equals eager: the same random life of a unit twice, once with everything computed, and after each act the same state to
 * the byte. LAZY_RUNS: how many lives, in place of the test's own number. */
#ifndef PSABENCH_TESTS_LAZY_LIVES_H
#define PSABENCH_TESTS_LAZY_LIVES_H

#include "unit/unit.h"

#include "board/psa2/board.h"
#include "canopen/co_node.h"

#include "rig.h"

#include <string.h>

#define ACTS_MAX 12u
#define LIFE_NS  INT64_C(2000000000)
#define LONG_NS  INT64_C(8000000000) /* asleep for so long that its temperature scan repeats itself */

/* ---- one life ---- */

struct life {
    struct sched s;
    struct lab lab;
    struct unit u, other; /* other: of another type, beside it, if there is one */
    const struct board_type *beside;
    struct can_bus bus;
    struct can_node client;
    struct sha256 wire; /* of all frames that the client has seen */
    struct trace_sink sink;
    struct sha256 edges;
    struct unit_observer ear;
    struct afe_fault afe;
    struct sensor_fault sensor;
    struct psa2_request request;
    bool faulty, asked, listens;
    int64_t end_ns;
    void (*accel)(void *ctx, unsigned axis, const struct looks *at, double *out); /* the unit's own */
    uint64_t samples;                                                             /* that the converters have taken */
    struct rng r;
};

static struct life life;

static void see_frame(void *ctx, const struct can_msg *m, int64_t t_ns)
{
    struct life *l = ctx;
    sha256_add(&l->wire, &t_ns, sizeof t_ns);
    sha256_add(&l->wire, &m->id, sizeof m->id);
    sha256_add(&l->wire, m->data, m->len);
}

static void see_steps(void *ctx, const struct trace_step *s, unsigned n)
{
    struct life *l = ctx;
    if (l->beside) return; /* in which pieces a frame is reported depends on what else is due */
    sha256_add(&l->edges, s, n * sizeof *s);
}

static void hear(void *ctx, unsigned event, int64_t t_ns)
{
    struct life *l = ctx;
    sha256_add(&l->edges, &event, sizeof event);
    sha256_add(&l->edges, &t_ns, sizeof t_ns);
}

static void count_samples(void *ctx, unsigned axis, const struct looks *at, double *out)
{
    life.samples += at->n;
    life.accel(ctx, axis, at, out);
}

static double uniform(struct life *l, double low, double high)
{
    return low + (high - low) * rng_uniform(&l->r);
}

static unsigned choose(struct life *l, unsigned n)
{
    return (unsigned)(rng_u64(&l->r) % n);
}

/* The article's, with clocks off by up to 100 ppm: no period is a whole number of nanoseconds. */
static const struct psa2_profile *random_profile(struct life *l)
{
    static struct psa2_profile p;
    fields_default(&psa2_fields, &p);
    if (choose(l, 2)) p.fclk_hz = (uint32_t)uniform(l, 4095600.0, 4096400.0);
    if (choose(l, 2)) p.temp_clkin_hz = (uint32_t)uniform(l, 7679300.0, 7680700.0);
    if (choose(l, 4) == 0) p.gate_sclk = false;
    if (choose(l, 3) == 0) p.sclk_hz = (uint32_t)uniform(l, 257e3, 1.9e6);
    if (choose(l, 3) == 0) p.temp_channels = (uint8_t)choose(l, 9);
    if (choose(l, 6) == 0) p.temp_load_ohm = uniform(l, 5e3, 30e3);
    return &p;
}

/* Of the article, or any other; every fifth has a loop that is too slow to sleep. */
static struct quartz_g random_quartz(struct life *l)
{
    struct quartz_g q = quartz_default();
    q.pendulum_given = choose(l, 2);
    q.natural_hz = (double[]){0.0, 3000.0, 350.0, 100.0, 30.0}[choose(l, 5)];
    q.damping = uniform(l, 0.5, 0.99);
    q.zero_ug = uniform(l, -150.0, 150.0);
    q.curve_ug = uniform(l, -500.0, 500.0);
    q.scale_curve_ppm = q.scale_tc_ppm_per_k = uniform(l, -100.0, 100.0);
    q.play_k = choose(l, 3) ? uniform(l, 0.0, 5.0) : 0.0;
    q.glue_ug = uniform(l, 0.0, 400.0);
    q.start_ug = choose(l, 2) ? 12.6 : 0.0;
    q.pendulous_ug_per_g2 = choose(l, 2) ? uniform(l, -200.0, 200.0) : 0.0;
    q.tilt_y_mrad = uniform(l, -2.0, 2.0);
    q.noise_a_rthz = choose(l, 2) ? 4e-10 : 0.0;
    q.limit_a = choose(l, 3) ? 0.0 : 1.1e-3; /* now and then in force */
    return q;
}

static enum unit_sensor random_sensor(struct life *l, bool quartz)
{
    if (choose(l, 20) == 0) return UNIT_NO_SENSOR;
    return quartz == (choose(l, 10) > 0) ? UNIT_QUARTZ : UNIT_MEMS;
}

static struct unit_cfg random_unit(struct life *l)
{
    const bool quartz = choose(l, 3) == 0;
    struct unit_cfg c = unit_default("a");
    c.board.seed = rng_u64(&l->r);
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        c.axis[i].sensor = random_sensor(l, quartz);
        c.axis[i].quartz = random_quartz(l);
        c.axis[i].mems = (struct mems_g){.u0_v = choose(l, 30) ? uniform(l, -0.5, 2.5) : 9.5,
                                         .kx_v_per_g = 1.2,
                                         .ky_v_per_g = 0.01,
                                         .drift_v_per_s = choose(l, 2) ? 1e-6 : 0.0,
                                         .u0_tc_v_per_k = choose(l, 2) ? 1e-4 : 0.0,
                                         .reading_noise_v = choose(l, 2) ? 50e-6 : 0.0,
                                         .bias_instability_v = choose(l, 30) ? 0.0 : 1e-5};
        c.board.afe[i] = afe_nominal(c.axis[i].sensor == UNIT_QUARTZ ? AFE_CURRENT : AFE_VOLTAGE);
        c.board.afe[i].filter_hz = choose(l, 30) ? 10e3 : 100.0;
        c.board.afe[i].divider_tc_ppm_per_k = choose(l, 2) ? 500.0 : 0.0;
    }
    c.board.adc_noise_scale = choose(l, 3) ? 1.0 : 0.0;
    c.board.adc_chain = choose(l, 40) ? 0 : choose(l, 3);
    c.mounting.on = LAB_HEAD;
    c.profile = random_profile(l);
    return c;
}

/* On the same bus, with sensors like those of the unit. */
static void begin_other(struct life *l, const struct unit_cfg *unit)
{
    struct unit_cfg c = unit_default("b");
    unit_cfg_type(&c, l->beside);
    memcpy(c.axis, unit->axis, sizeof c.axis);
    for (unsigned i = 0; i < UNIT_AXES; i++) c.axis[i].sensor = UNIT_MEMS;
    c.mounting.on = LAB_HEAD;
    c.board.serial = 2;
    unit_init(&l->other, &c, &l->lab, &l->s);
    const struct board_can_cfg can = {.name = "b", .node_id = (uint8_t)(unit->node + 1u)};
    unit_connect(&l->other, &can, &l->bus, &l->s);
}

static void begin(struct life *l, uint64_t seed, const struct board_type *beside, bool eager)
{
    static const struct can_bus_cfg bus = {.bitrate_hz = 1000000};
    memset(l, 0, sizeof *l);
    l->beside = beside;
    l->r = rng_stream(seed, 0, "lazy");
    sched_init(&l->s);
    l->s.eager = eager;
    struct lab_cfg world = lab_default();
    world.chamber.present = choose(l, 2);
    world.chamber.ramp_k_per_min = world.chamber.heating_max_k_per_min = world.chamber.cooling_max_k_per_min = 600.0;
    world.chamber.tau_case_s = 0.5;
    world.chamber.tau_element_s = choose(l, 2) ? 0.3 : 360.0;
    world.head = (struct head_cfg){.turn_s = uniform(l, 0.0, choose(l, 2) ? 0.3 : 2.0)};
    lab_init(&l->lab, &world, 1);
    const struct unit_cfg c = random_unit(l);
    unit_init(&l->u, &c, &l->lab, &l->s);
    can_bus_init(&l->bus, &bus, &l->s);
    l->accel = l->u.board->io.accel;
    l->u.board->io.accel = count_samples;
    const struct board_can_cfg can = {.name = "a", .node_id = c.node};
    unit_connect(&l->u, &can, &l->bus, &l->s);
    if (beside) begin_other(l, &c);
    l->client = (struct can_node){.name = "client", .order = CAN_ORDER_FIFO, .rx = see_frame, .ctx = l};
    can_attach(&l->bus, &l->client);
    l->sink = (struct trace_sink){.steps = see_steps, .ctx = l};
    l->ear = (struct unit_observer){.fn = hear, .ctx = l};
    sha256_init(&l->wire);
    sha256_init(&l->edges);
    unit_power_up(&l->u, 0);
    if (beside) unit_power_up(&l->other, 0);
}

/* ---- acts ---- */

static void do_nothing(struct life *l)
{
    (void)l;
}

static void turn_head(struct life *l)
{
    unit_sample_until(&l->u, l->s.now_ns);
    if (l->beside) unit_sample_until(&l->other, l->s.now_ns);
    head_turn(&l->lab.head, uniform(l, -180.0, 180.0), l->s.now_ns);
}

static void heat(struct life *l)
{
    if (!l->lab.chamber.cfg.present) return;
    unit_sample_until(&l->u, l->s.now_ns);
    if (l->beside) unit_sample_until(&l->other, l->s.now_ns);
    if (choose(l, 3) == 0) chamber_overshoot(&l->lab.chamber, uniform(l, 0.0, 10.0), l->s.now_ns);
    (void)chamber_set(&l->lab.chamber, uniform(l, -50.0, 80.0), l->s.now_ns);
}

static void say(struct life *l, uint32_t id, const uint8_t *data, uint8_t n)
{
    struct can_msg m = {.id = id, .len = n};
    memcpy(m.data, data, n);
    (void)can_send(&l->bus, &l->client, &m, l->s.now_ns);
}

static void command_nmt(struct life *l)
{
    static const uint8_t commands[] = {0x01, 0x80, 0x02, 0x80};
    say(l, 0x000, (const uint8_t[]){commands[choose(l, sizeof commands)], 0}, 2);
}

/* Latest codes, raw words, counters, a register: the bus is busy for some time. */
static void read_object(struct life *l)
{
    static const uint16_t objects[] = {PSA2_OD_CODES, PSA2_OD_RAW_WORDS, PSA2_OD_COUNTERS, PSA2_OD_REG_X};
    const uint16_t index = objects[choose(l, COUNT(objects))];
    const uint8_t ask[8] = {0x40, (uint8_t)index, (uint8_t)(index >> 8), (uint8_t)(1 + choose(l, 3))};
    for (unsigned n = choose(l, 12); n < 12; n++) say(l, 0x600u + l->u.cfg.node, ask, sizeof ask);
}

static void answered(void *ctx, struct psa2_request *r, enum psa2_result result, int64_t t_ns)
{
    struct life *l = ctx;
    sha256_add(&l->edges, r->answer, sizeof r->answer);
    sha256_add(&l->edges, &result, sizeof result);
    sha256_add(&l->edges, &t_ns, sizeof t_ns);
}

/* Through the board's controller, as psa2_submit() has it: CONFIG0 with another rate or phase, DRATE, a SYNC pulse, a
 * read. */
static void ask_controller(struct life *l)
{
    static const uint8_t config0[] = {0x52, 0x56, 0x4A, 0x5A, 0x53, 0x62}, drate[] = {0xF0, 0xB0, 0xA1, 0x82, 0x23};
    struct psa2 *b = (struct psa2 *)l->u.board;
    if (l->asked && b->request) return;
    l->request = (struct psa2_request){.group = choose(l, 2) ? PSA2_ACCEL : PSA2_TEMP, .done = answered, .ctx = l};
    l->request.op = (enum psa2_op[]){PSA2_READ_REG, PSA2_WRITE_REG, PSA2_PULSE_SYNC}[choose(l, 3)];
    const bool accel = l->request.group == PSA2_ACCEL;
    l->request.addr = accel ? ADS1282_CONFIG0 : choose(l, 2) ? ADS1256_MUX : ADS1256_DRATE;
    l->request.value = accel                            ? config0[choose(l, sizeof config0)]
                       : l->request.addr == ADS1256_MUX ? 0x08
                                                        : drate[choose(l, sizeof drate)];
    l->asked = psa2_submit(b, &l->request, l->s.now_ns) == PSA2_OK;
}

static void watch_lines(struct life *l)
{
    trace_detach(&l->u.board->trace, &l->sink);
    if (l->sink.mask) l->sink.mask = 0;
    else l->sink.mask = 1u << choose(l, PSA2_LINES) | 1u << choose(l, PSA2_LINES);
    if (l->sink.mask) trace_attach(&l->u.board->trace, &l->sink);
}

static void listen(struct life *l)
{
    l->listens = !l->listens;
    if (l->listens) unit_subscribe(&l->u, &l->ear);
    else unit_unsubscribe(&l->u, &l->ear);
}

static void break_something(struct life *l)
{
    struct psa2 *b = (struct psa2 *)l->u.board;
    unit_sample_until(&l->u, l->s.now_ns);
    if (l->faulty) {
        afe_fault_remove(&l->u.board->afe[0], &l->afe);
        sensor_fault_remove(&l->u.sensor_faults[1], &l->sensor);
        ads1282_fault(&b->adc[2], &(struct chip_fault){0}, l->s.now_ns);
        ads1256_fault(&b->tadc, &(struct chip_fault){0}, l->s.now_ns);
        l->faulty = false;
        return;
    }
    l->faulty = true;
    l->afe = (struct afe_fault){.kind = AFE_LOAD_SHORT, .from_ns = l->s.now_ns};
    l->sensor = (struct sensor_fault){.kind = SENSOR_BIAS, .value = 0.1, .from_ns = l->s.now_ns};
    const struct chip_fault chip = {.clock_ppm = 150}, deaf = {.lost_sync = true};
    switch (choose(l, 5)) {
    case 0:
        afe_fault_add(&l->u.board->afe[0], &l->afe);
        break;
    case 1:
        sensor_fault_add(&l->u.sensor_faults[1], &l->sensor);
        break;
    case 2:
        ads1282_fault(&b->adc[2], &chip, l->s.now_ns);
        break;
    default:
        ads1256_fault(&b->tadc, choose(l, 2) ? &chip : &deaf, l->s.now_ns);
    }
}

static void reset(struct life *l)
{
    if (choose(l, 2)) l->u.type->reset(l->u.board, l->s.now_ns);
    else {
        unit_power_down(&l->u, l->s.now_ns);
        unit_power_up(&l->u, l->s.now_ns);
    }
}

typedef void act_fn(struct life *l);
static act_fn *const acts[] = {do_nothing,  do_nothing,      turn_head,   turn_head,      heat,
                               command_nmt, read_object,     read_object, ask_controller, watch_lines,
                               listen,      break_something, reset};

/* ---- what is compared ---- */

static void add_chip(struct sha256 *h, const struct ads1282 *a)
{
    sha256_add(h, &a->count, sizeof a->count);
    sha256_add(h, &a->next, sizeof a->next);
    sha256_add(h, &a->ended, sizeof a->ended);
    sha256_add(h, &a->update_ns, sizeof a->update_ns);
    sha256_add(h, &a->sclk_ns, sizeof a->sclk_ns);
    sha256_add(h, &a->rest_periods, sizeof a->rest_periods);
}

static void add_quartz(struct sha256 *h, const struct quartz *q)
{
    sha256_add(h, &q->terms, sizeof q->terms);
    sha256_add(h, &q->t_ns, sizeof q->t_ns);
    sha256_add(h, &q->end_ns, sizeof q->end_ns);
    sha256_add(h, q->loop, sizeof q->loop);
    sha256_add(h, &q->held_a, sizeof q->held_a);
}

static void add_board(struct sha256 *h, struct psa2 *b)
{
    b->base.type->digest(&b->base, h);
    sha256_add(h, &b->latest, sizeof b->latest);
    sha256_add(h, &b->out.f, sizeof b->out.f);
    sha256_add(h, &b->counters, sizeof b->counters);
    sha256_add(h, &b->tadc.n, sizeof b->tadc.n);
    if (!life.beside) sha256_add(h, &b->base.trace.level, sizeof b->base.trace.level); /* as far as it is reported */
    sha256_add(h, b->spi.rx, sizeof b->spi.rx);
    sha256_add(h, &b->timeout_ns, sizeof b->timeout_ns);
    sha256_add(h, &b->board_degc, sizeof b->board_degc);
    for (unsigned i = 0; i < UNIT_AXES; i++) {
        add_chip(h, &b->adc[i]);
        add_quartz(h, &life.u.quartz[i]);
        sha256_add(h, &b->base.afe[i].state_v, sizeof b->base.afe[i].state_v);
        sha256_add(h, &b->base.afe[i].t_ns, sizeof b->base.afe[i].t_ns);
    }
}

static void take_state(struct life *l, char out[SHA256_HEX])
{
    struct sha256 h, wire = l->wire, edges = l->edges;
    char hex[SHA256_HEX];
    assert_int_equal(l->s.asleep, 0);
    sha256_init(&h);
    add_board(&h, (struct psa2 *)l->u.board);
    if (l->beside) l->beside->digest(l->other.board, &h);
    for (const struct sched_ev *e = l->s.first; e; e = e->next) sha256_add(&h, &e->due_ns, sizeof e->due_ns);
    sha256_hex(&wire, hex);
    sha256_add(&h, hex, sizeof hex);
    sha256_hex(&edges, hex);
    sha256_add(&h, hex, sizeof hex);
    sha256_hex(&h, out);
}

/* To a look that was known beforehand or, as from a client, was not: the unit is then awake somewhat later. */
static void run_to_look(struct life *l, int64_t to_ns)
{
    if (choose(l, 3)) {
        sched_run_until(&l->s, to_ns);
        return;
    }
    sched_run_towards(&l->s, to_ns, l->end_ns);
    sched_settle(&l->s);
}

/* How long lives are, and what type of board is beside the unit, or NULL. */
struct kind {
    int64_t end_ns;
    const struct board_type *beside;
};

/* A life with the state after each stretch; returns how many. The eager one looks when the lazy one has. */
static unsigned live(uint64_t seed, const struct kind *k, bool eager, char state[][SHA256_HEX], int64_t at_ns[])
{
    struct life *l = &life;
    const int64_t end_ns = k->end_ns;
    begin(l, seed, k->beside, eager);
    l->end_ns = end_ns;
    const unsigned n = 1 + choose(l, end_ns > LIFE_NS ? 2 : ACTS_MAX);
    for (unsigned i = 0; i < n; i++) {
        const int64_t left_ns = end_ns - l->s.now_ns;
        const double share = i + 1 == n ? 1.0 : uniform(l, 0.0, 2.0 / (n - i));
        const int64_t to_ns = l->s.now_ns + (int64_t)(share * (double)left_ns);
        if (eager) {
            (void)choose(l, 3);
            sched_run_until(&l->s, at_ns[i]);
        } else run_to_look(l, to_ns < end_ns ? to_ns : end_ns);
        at_ns[i] = l->s.now_ns;
        take_state(l, state[i]);
        acts[choose(l, COUNT(acts))](l);
        trace_advance(&l->u.board->trace, l->s.now_ns);
    }
    return n;
}

static inline unsigned life_count(unsigned standard)
{
    const char *s = getenv("LAZY_RUNS");
    return s ? (unsigned)strtoul(s, NULL, 0) : standard;
}

/* Both lives; whether the lazy one has left samples out. */
static bool compare_lives(uint64_t seed, const struct kind *k)
{
    char eager[ACTS_MAX][SHA256_HEX], lazy[ACTS_MAX][SHA256_HEX];
    int64_t at_ns[ACTS_MAX];
    const unsigned n = live(seed, k, false, lazy, at_ns);
    const uint64_t taken = life.samples;
    live(seed, k, true, eager, at_ns);
    for (unsigned i = 0; i < n; i++)
        if (memcmp(eager[i], lazy[i], SHA256_HEX) != 0)
            fail_msg("TEST_SEED=%llu LAZY_RUNS=1: look %u of %u differs", (unsigned long long)seed, i + 1, n);
    return taken < life.samples;
}

/* At least one life in ten has to have slept: else the comparison says little. */
static inline void live_lives(unsigned standard, struct kind k)
{
    const unsigned runs = life_count(standard);
    const uint64_t seed = rig_seed(2026);
    unsigned slept = 0;
    for (unsigned run = 0; run < runs; run++) slept += compare_lives(seed + run, &k);
    print_message("%u lives, of which %u slept\n", runs, slept);
    if (runs >= 10) assert_true(slept >= runs / 10);
}

#endif
