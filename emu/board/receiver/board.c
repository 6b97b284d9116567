#include "board/receiver/board.h"

#include "board/digest.h"
#include "board/life.h"

#include <stdio.h>

/* ---- profile ---- */

static void describe_profile(const void *profile, char *out, size_t cap)
{
    const struct receiver_profile *p = profile;
    (void)snprintf(out, cap, "%u solutions a second, %u messages each at %u bit/s, latency %.4g s", p->rate_hz,
                   p->message_count, p->baud, p->position_delay_s);
}

/* ---- what is on it ---- */

#define COUNT(field) BOARD_COUNTER(receiver_counters, field, field)

static const struct board_counter counters[] = {COUNT(solutions), COUNT(fixes), COUNT(resets), COUNT(messages),
                                                COUNT(lost_messages)};
static const struct board_part parts[] = {
    {.name = "solver", .label = "board", .offset = offsetof(struct receiver, counters), BOARD_COUNTERS(counters)}};
static const struct board_controller_fault controller_faults[] = {
    {"controller.frozen_words", RECEIVER_FAULT_FROZEN_WORDS},
    {NULL, 0},
};
static const char *const port_lines[] = {"PPS", "SOL", "TXD", NULL};

static void set_receiver_faults(struct board *board, const struct board_receiver_faults *f, int64_t t_ns)
{
    receiver_set_faults((struct receiver *)board, f, t_ns);
}
static const struct board_receiver receiver = {.set_faults = set_receiver_faults};

static uint32_t baud_of(const struct board *board)
{
    return ((const struct receiver *)board)->profile.baud;
}

static void list_unfit(const struct board *board, char *unfit, size_t cap)
{
    receiver_profile_unfit(&((const struct receiver *)board)->profile, unfit, cap);
}

static void connect_serial(struct board *board, void (*sent)(void *ctx, uint8_t byte, int64_t t_ns), void *ctx)
{
    struct receiver_tx *tx = &((struct receiver *)board)->tx;
    tx->sent = sent;
    tx->ctx = ctx;
}
static const struct board_serial serial = {.baud = baud_of, .unfit = list_unfit, .connect = connect_serial};

/* ---- life ---- */

BOARD_LIFE(receiver);

static bool is_ready(const struct board *board)
{
    const struct receiver *b = (const struct receiver *)board;
    return b->on && b->latest.report.fix != REPORT_NO_FIX;
}

static unsigned list_noises(struct board *board, struct draws *at[BOARD_NOISES_MAX])
{
    struct receiver *b = (struct receiver *)board;
    at[0] = &b->errors.noise;
    at[1] = &b->errors.slow;
    at[2] = &b->errors.event;
    at[3] = &b->checksum;
    return 4;
}

static void put_truth(const struct board *board, board_truth_fn *put, void *ctx)
{
    const struct receiver *b = (const struct receiver *)board;
    board_put_truth(put, ctx, b->profile.position_delay_s, "position_delay_s");
    board_put_truth(put, ctx, b->profile.velocity_delay_s, "velocity_delay_s");
}

/* ---- digest ---- */

static void add_reals(struct sha256 *s, const double *v, size_t n)
{
    for (size_t i = 0; i < n; i++) board_digest_real(s, v[i]);
}

static void add_event(struct sha256 *s, const struct sched_ev *e)
{
    board_digest_u64(s, (uint64_t)(e->queued ? e->due_ns : -1));
}

static void add_reading(struct sha256 *s, const struct receiver_reading *r)
{
    const struct report *p = &r->report;
    board_digest_u64(s, (uint64_t)r->seq << 32 | (uint64_t)p->fix);
    board_digest_u64(s, (uint64_t)p->utc_ms);
    board_digest_u64(s, (uint64_t)(uint32_t)p->lat_e7 << 32 | (uint32_t)p->lon_e7);
    board_digest_u64(s, (uint32_t)p->h_mm);
    for (unsigned i = 0; i < 3; i++) board_digest_u64(s, (uint32_t)p->v_n_mmps[i]);
}

static void add_errors(struct sha256 *s, const struct receiver_errors *e)
{
    board_digest_noise(s, &e->noise);
    board_digest_noise(s, &e->slow);
    board_digest_noise(s, &e->event);
    board_digest_u64(s, (uint64_t)e->number);
    board_digest_u64(s, (uint64_t)e->outage_until_ns);
    add_reals(s, e->slow_unit, 6);
    add_reals(s, e->jump_m, 3);
    add_reals(s, e->offset.rate_mps, 2);
    add_reals(s, e->offset.base_m, 2);
    add_reals(s, e->offset.jump_m, 2);
    board_digest_u64(s, (uint64_t)e->offset.from_ns);
}

static void add_faults(struct sha256 *s, const struct receiver *b)
{
    const struct board_receiver_faults *f = &b->wrong;
    board_digest_u64(s, (uint64_t)b->base.faults << 2 | (uint64_t)f->outage << 1 | f->frozen_time);
    board_digest_u64(s, (uint32_t)f->weeks);
    board_digest_real(s, f->checksum_probability);
}

static void add_tx(struct sha256 *s, const struct receiver_tx *tx)
{
    board_digest_u64(s, (uint64_t)tx->clock.t0_ns);
    board_digest_u64(s, (uint64_t)tx->bytes);
    board_digest_u64(s, tx->count);
    for (unsigned i = 0; i < tx->count; i++) sha256_add(s, &tx->ring[(tx->first + i) % RECEIVER_TX_BYTES], 1);
    add_event(s, &tx->ev);
}

static void add_digest(const struct board *board, struct sha256 *s)
{
    const struct receiver *b = (const struct receiver *)board;
    board_digest_u64(s, b->on);
    board_digest_u64(s, (uint64_t)b->from_ns);
    add_errors(s, &b->errors);
    add_faults(s, b);
    add_reading(s, &b->solved);
    add_reading(s, &b->latest);
    add_event(s, &b->solve_ev);
    add_event(s, &b->output_ev);
    add_event(s, &b->pps_ev);
    add_event(s, &b->sol_ev);
    add_tx(s, &b->tx);
    sha256_add(s, &b->counters, sizeof b->counters);
    board_digest_noise(s, &b->checksum);
}

static const char *why_eager(struct board *board, int64_t t_ns)
{
    (void)board;
    (void)t_ns;
    return "its slow errors go on from solution to solution";
}

const struct board_type receiver_board = {
    .name = "receiver",
    .title = "Receiver",
    .size = sizeof(struct receiver),
    .fields = &receiver_fields,
    .profile_name = "receiver",
    .profile_check = receiver_profile_check,
    .about = describe_profile,
    .node = 12,
    .period_ns = receiver_period_ns,
    .lines = receiver_lines,
    .line_count = RECEIVER_LINES,
    .port_lines = port_lines,
    .frame_line = RECEIVER_LINE_SOL,
    .pulse_line = RECEIVER_LINE_SOL,
    .events = receiver_events,
    .event_count = RECEIVER_EVENTS,
    .parts = parts,
    .part_count = sizeof parts / sizeof *parts,
    .controller_faults = controller_faults,
    .can = &receiver_can,
    .receiver = &receiver,
    .serial = &serial,
    BOARD_LIFE_FUNCTIONS,
    .ready = is_ready,
    .why_eager = why_eager,
    .noises = list_noises,
    .digest = add_digest,
    .truth = put_truth,
};
