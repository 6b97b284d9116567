/* The receiver's program: a solution at each instant of its grid, put out a little later. */
#include "board/receiver/receiver.h"

#include "base/detmath.h"

#include <math.h>

#define NS_A_MS       1000000
#define MS_A_WEEK     INT64_C(604800000)
#define SOL_PULSE_NS  1000000
#define E7_A_DEG      1e7
#define LON_WEST_MOST (-1800000000) /* the same meridian as +180 deg, which is written */
#define TIME_ACC_NS   30u           /* of a solution's time, as it believes (E0) */
#define V_MOST_MMPS   1e9
#define H_MOST_MM     2e9

const struct board_line receiver_lines[RECEIVER_LINES] = {
    [RECEIVER_LINE_PPS] = {"PPS", false},
    [RECEIVER_LINE_SOL] = {"SOL", false},
    [RECEIVER_LINE_TXD] = {"TXD", true},
};
const char *const receiver_events[RECEIVER_EVENTS] = {"RES", "SOLUTION", "FIX", "FIX_LOST", "POWER_DOWN", "POWER_UP"};

/* ---- a solution as it is reported */

static int32_t round_within(double x, double most)
{
    return (int32_t)floor(fmin(fmax(x, -most), most) + 0.5);
}

static uint32_t accuracy_mm(double sd)
{
    return (uint32_t)(sd * 1000.0 + 0.5);
}

static void report_place(struct report *r, const struct place *p)
{
    r->lat_e7 = round_within(p->lat_rad / RAD_PER_DEG * E7_A_DEG, 90.0 * E7_A_DEG);
    r->lon_e7 = round_within(p->lon_rad / RAD_PER_DEG * E7_A_DEG, 180.0 * E7_A_DEG);
    if (r->lon_e7 == LON_WEST_MOST) r->lon_e7 = -LON_WEST_MOST;
    r->h_mm = round_within(p->h_m * 1000.0, H_MOST_MM);
    for (unsigned i = 0; i < 3; i++) r->v_n_mmps[i] = round_within(p->v_n_mps[i] * 1000.0, V_MOST_MMPS);
}

static void report_accuracy(struct report *r, const struct receiver_errors_cfg *c)
{
    const double sqrt_2 = 1.4142135623730951; /* hAcc is of two axes */
    r->h_acc_mm = accuracy_mm(receiver_errors_sd_m(c) * sqrt_2);
    r->v_acc_mm = accuracy_mm(receiver_errors_sd_m(c) * c->vertical_ratio);
    r->s_acc_mmps = accuracy_mm(receiver_errors_sd_mps(c) * sqrt_2);
    r->t_acc_ns = TIME_ACC_NS;
}

static int64_t time_of(const struct receiver *b, int64_t t_ns)
{
    if (b->wrong.frozen_time) return b->solved.report.utc_ms;
    return b->start_utc_ms + t_ns / NS_A_MS + (int64_t)b->wrong.weeks * MS_A_WEEK;
}

static void solve_at(struct receiver *b, int64_t t_ns)
{
    struct receiver_solution s;
    struct report *r = &b->solved.report;
    receiver_errors_solve(&b->errors, b->base.io.place, b->base.io.ctx, t_ns, &s);
    r->utc_ms = time_of(b, t_ns);
    r->fix = s.valid && !b->wrong.outage && t_ns >= b->from_ns ? REPORT_FIX_3D : REPORT_NO_FIX;
    if (r->fix && !(b->base.faults & RECEIVER_FAULT_FROZEN_WORDS)) report_place(r, &s.place);
    b->solved.seq++;
}

static void put_out(void *ctx, int64_t t_ns)
{
    struct receiver *b = ctx;
    const bool had = b->latest.report.fix != REPORT_NO_FIX, has = b->solved.report.fix != REPORT_NO_FIX;
    b->latest = b->solved;
    b->counters.solutions++;
    b->counters.fixes += has;
    if (has != had) board_notify(&b->base, has ? RECEIVER_EV_FIX : RECEIVER_EV_FIX_LOST, t_ns);
    board_notify(&b->base, RECEIVER_EV_SOLUTION, t_ns);
    if (b->on_reading) b->on_reading(b->can, &b->latest, t_ns);
    receiver_tx_report(b, &b->latest.report, t_ns);
}

/* The grid's next instant after t_ns. */
static int64_t next_ns(int64_t period_ns, int64_t t_ns)
{
    return (t_ns / period_ns + 1) * period_ns;
}

static void solve_periodically(void *ctx, int64_t t_ns)
{
    struct receiver *b = ctx;
    solve_at(b, t_ns);
    trace_set(&b->base.trace, RECEIVER_LINE_SOL, true, t_ns);
    sched_at(b->base.sched, &b->sol_ev, t_ns + SOL_PULSE_NS);
    sched_at(b->base.sched, &b->output_ev, t_ns + (int64_t)b->profile.compute_ms * NS_A_MS);
    sched_at(b->base.sched, &b->solve_ev, next_ns(b->errors.cfg.period_ns, t_ns));
}

/* ---- lines */

static void end_sol(void *ctx, int64_t t_ns)
{
    trace_set(&((struct receiver *)ctx)->base.trace, RECEIVER_LINE_SOL, false, t_ns);
}

/* Up at each whole second of UTC, which are those of the bench's time. */
static void toggle_pps(void *ctx, int64_t t_ns)
{
    struct receiver *b = ctx;
    const bool up = t_ns % NS_PER_S == 0;
    trace_set(&b->base.trace, RECEIVER_LINE_PPS, up, t_ns);
    sched_at(b->base.sched, &b->pps_ev, up ? t_ns + RECEIVER_PPS_NS : next_ns(NS_PER_S, t_ns));
}

static void rest_lines(struct receiver *b, int64_t t_ns)
{
    trace_put(&b->base.trace, TRACE_FIRST(RECEIVER_LINES), b->on ? TRACE_BIT(RECEIVER_LINE_TXD) : 0, t_ns);
}

/* ---- faults */

void receiver_set_faults(struct receiver *b, const struct board_receiver_faults *f, int64_t t_ns)
{
    b->wrong = *f;
    b->errors.offset = (struct receiver_offset){.rate_mps = {f->rate_mps[0], f->rate_mps[1]},
                                                .base_m = {f->base_m[0], f->base_m[1]},
                                                .from_ns = t_ns,
                                                .jump_m = {f->jump_m[0], f->jump_m[1]}};
}

/* ---- life */

void receiver_init(struct receiver *b, const struct receiver_profile *p, const struct board_cfg *cfg,
                   const struct board_io *io, struct sched *s)
{
    const struct receiver_errors_cfg errors = receiver_profile_errors(p);
    board_clear(&b->base, sizeof *b);
    b->profile = *p;
    board_init(&b->base, receiver_lines, RECEIVER_LINES, cfg, io, s);
    receiver_errors_init(&b->errors, &errors, cfg->seed, cfg->serial);
    b->checksum = board_draws(&b->base, "receiver.checksum");
    (void)calendar_parse(p->start_utc, &b->start_utc_ms); /* receiver_profile_check() has read it */
    sched_ev_inner(&b->solve_ev, solve_periodically, b);
    sched_ev_inner(&b->output_ev, put_out, b);
    sched_ev_inner(&b->pps_ev, toggle_pps, b);
    sched_ev_inner(&b->sol_ev, end_sol, b);
    b->base.trace.source = (struct trace_source){.wake = receiver_tx_wake, .ctx = b};
    receiver_tx_init(&b->tx, p, b);
}

static struct receiver_reading nothing_yet(const struct receiver *b)
{
    const struct receiver_profile *p = &b->profile;
    struct receiver_reading r = {.seq = 0};
    r.report = (struct report){.leap_s = (int)p->leap_s,
                               .utc_ms = b->start_utc_ms,
                               .geoid_mm = round_within(p->geoid_m * 1000.0, H_MOST_MM),
                               .sats = p->sats,
                               .hdop_e2 = (unsigned)(p->hdop * 100.0 + 0.5),
                               .vdop_e2 = (unsigned)(p->vdop * 100.0 + 0.5)};
    report_accuracy(&r.report, &b->errors.cfg);
    return r;
}

static void stop_solutions(struct receiver *b, int64_t t_ns)
{
    sched_cancel(b->base.sched, &b->solve_ev);
    sched_cancel(b->base.sched, &b->output_ev);
    sched_cancel(b->base.sched, &b->pps_ev);
    sched_cancel(b->base.sched, &b->sol_ev);
    receiver_tx_clear(b);
    rest_lines(b, t_ns);
}

static void start_solutions(struct receiver *b, int64_t t_ns)
{
    rest_lines(b, t_ns);
    b->solved = b->latest = nothing_yet(b);
    b->from_ns = t_ns + (int64_t)(b->profile.first_fix_s * (double)NS_PER_S);
    receiver_errors_restart(&b->errors);
    sched_at(b->base.sched, &b->solve_ev, next_ns(b->errors.cfg.period_ns, t_ns));
    sched_at(b->base.sched, &b->pps_ev, next_ns(NS_PER_S, t_ns));
}

void receiver_power_up(struct receiver *b, int64_t t_ns)
{
    b->on = true;
    start_solutions(b, t_ns);
    board_notify(&b->base, RECEIVER_EV_POWER_UP, t_ns);
}

void receiver_power_down(struct receiver *b, int64_t t_ns)
{
    b->on = false;
    stop_solutions(b, t_ns);
    board_notify(&b->base, RECEIVER_EV_POWER_DOWN, t_ns);
}

void receiver_reset(struct receiver *b, int64_t t_ns)
{
    if (!b->on) return;
    b->counters.resets++;
    stop_solutions(b, t_ns);
    start_solutions(b, t_ns);
    board_notify(&b->base, RECEIVER_EV_RES, t_ns);
}

/* It looks at nothing between two solutions. */
void receiver_sample_until(struct receiver *b, int64_t t_ns)
{
    (void)b;
    (void)t_ns;
}
