/* Self-monitoring of the angle sensor and the torquers: while servoed, in navigation, and by a nod on request.
 *
 * In navigation nothing is taken from the angle sensor, so it is independent. A dead azimuth torquer leaves the platform
 * turning at what was asked of it, backwards; a platform off the level has lost its horizon; an angle sensor that stands still
 * while the reported track turns is stuck. One that stands still without a reported track proves nothing:
 * for that there is the nod. Limits: E0. docs/boards/gyro.md has what cannot be seen. */
#include "board/gyro/internal.h"

#include "base/detmath.h"

#include <math.h>
#include <string.h>

#define CHECK_NS INT64_C(500000000) /* over which the angle sensor is held against the torquer */

/* A block of navigation is so much asked of the azimuth torquer. The sensor runs against all of it but a quarter, twice in a
 * row: dead. */
#define BLOCK_RAD   (0.25 * RAD_PER_DEG)
#define BLOCK_PART  0.25
#define BLOCKS_DEAD 2u

/* Aiding: a reported track that changed by so much, at so much speed, and an angle sensor that has not left its degree. A turn
 * reported late is reported by LATE_NS after it; a turn reported ahead is over by then, too. */
#define ALOFT_MPS 20.0
#define STILL_RAD (1.0 * RAD_PER_DEG)
#define TOLD_DEG  20.0
#define LATE_NS   INT64_C(600000000000)
#define AHEAD_NS  INT64_C(120000000000)

#define NOD_RADPS   (0.2 * RAD_PER_DEG)
#define NOD_NS      INT64_C(500000000) /* there, and the same back */
#define NOD_REST_NS INT64_C(700000000) /* before the next: not in step with a sway */
#define NODS        3u

/* ---- conditions ---- */

/* For observers that poll. */
static void record_flag(struct gyro *b, enum gyro_flag what)
{
    for (unsigned i = 0; i < GYRO_FLAGS; i++) {
        if (what != 1U << i) continue;
        b->past[i].begun++;
        b->past[i].step = b->number + 1;
    }
}

void gyro_past_begin(struct gyro *b)
{
    memset(b->past, 0, sizeof b->past);
    for (unsigned i = 0; i < GYRO_FLAGS; i++)
        if (b->standing & 1U << i) record_flag(b, (enum gyro_flag)(1U << i));
}

void gyro_condition(struct gyro *b, enum gyro_flag what, bool active, int64_t t_ns)
{
    if (active == ((b->standing & what) != 0)) return;
    b->standing = active ? b->standing | what : b->standing & ~(unsigned)what;
    if (active) record_flag(b, what);
    if (active) board_notify(&b->base, GYRO_EV_FAULT, t_ns);
    if (b->host.condition) b->host.condition(b->host.ctx, what, active, t_ns);
}

void gyro_report_encoder_fault(struct gyro *b, int64_t t_ns)
{
    if (b->standing & GYRO_ENCODER_FAULT) return;
    b->counters.encoder_faults++;
    gyro_condition(b, GYRO_ENCODER_FAULT, true, t_ns);
}

/* ---- servoed ---- */

/* Half a second of driving without the angle sensor moving: it is stuck, or the torquer is dead. */
static bool servo_fails(struct gyro *b)
{
    struct gyro_check *c = &b->check;
    c->turned_rad += b->u_radps[1] * (1e-9 * b->profile.step_ns);
    if ((int64_t)++c->steps * b->profile.step_ns < CHECK_NS) return false;
    const double moved_rad = gyro_wrap_rad(b->servo_rad - c->from_rad);
    const bool dead = fabs(c->turned_rad) > b->profile.stuck_turn_deg * RAD_PER_DEG &&
                      fabs(moved_rad) < b->profile.stuck_moved_deg * RAD_PER_DEG;
    *c = (struct gyro_check){.from_rad = b->servo_rad};
    return dead;
}

/* ---- in navigation ---- */

void gyro_check_begin(struct gyro *b, int64_t t_ns)
{
    b->check = (struct gyro_check){.from_rad = b->servo_rad};
    b->watch = (struct gyro_watch){.from_rad = b->servo_rad,
                                   .track_deg = b->set.track_deg,
                                   .level_ns = t_ns,
                                   .still_rad = b->servo_rad,
                                   .still_ns = t_ns,
                                   .told_deg = b->set.track_deg};
    b->nod = (struct gyro_nod){.nods = 0};
}

static double told_rad(double to_deg, double from_deg)
{
    return gyro_wrap_rad((to_deg - from_deg) * RAD_PER_DEG);
}

/* The torquer: what the sensor moved by, less the reported turn, against what was asked; of a nod nothing is left. */
static void check_torquer(struct gyro *b, int64_t t_ns)
{
    struct gyro_watch *w = &b->watch;
    w->turned_rad += b->u_radps[1] * (1e-9 * b->profile.step_ns);
    if (fabs(w->turned_rad) < BLOCK_RAD || b->nod.way != GYRO_NOD_NONE) return;
    const double moved_rad = gyro_wrap_rad(b->servo_rad - w->from_rad - told_rad(b->set.track_deg, w->track_deg));
    const bool against = fabs(moved_rad + w->turned_rad) < BLOCK_PART * fabs(w->turned_rad);
    w->against = against ? w->against + 1 : 0;
    w->turned_rad = 0.0;
    w->from_rad = b->servo_rad;
    w->track_deg = b->set.track_deg;
    if (w->against >= BLOCKS_DEAD) gyro_report_encoder_fault(b, t_ns);
}

/* The sensor: it stands still while the reported track turns. */
static void check_aided(struct gyro *b, int64_t t_ns)
{
    struct gyro_watch *w = &b->watch;
    const bool moves = fabs(gyro_wrap_rad(b->servo_rad - w->still_rad)) > STILL_RAD;
    if (moves || b->set.speed_mps < ALOFT_MPS) {
        w->still_rad = b->servo_rad;
        w->still_ns = t_ns;
    }
    if (t_ns - w->still_ns < LATE_NS) w->told_deg = b->set.track_deg;
    const bool told = fabs(told_rad(b->set.track_deg, w->told_deg)) > TOLD_DEG * RAD_PER_DEG;
    if (!told) w->told_ns = t_ns;
    else if (t_ns - w->told_ns >= AHEAD_NS) gyro_report_encoder_fault(b, t_ns);
}

/* The horizon: as long off the level as a run would wait for it. */
static void check_level(struct gyro *b, int64_t t_ns)
{
    const double tolerance_rad = b->set.tolerance_arcmin / 60.0 * RAD_PER_DEG;
    if (fabs(b->level.beta_rad) <= tolerance_rad) b->watch.level_ns = t_ns;
    const double off_s = 1e-9 * (double)(t_ns - b->watch.level_ns);
    if (off_s > b->set.settle_s + b->set.settle_limit_s) gyro_condition(b, GYRO_NOT_SETTLED, true, t_ns);
}

bool gyro_check_step(struct gyro *b, int64_t t_ns)
{
    if (b->run.servoed && servo_fails(b)) return false;
    if (b->run.mode != GYRO_NAVIGATE) return true;
    check_torquer(b, t_ns);
    check_aided(b, t_ns);
    check_level(b, t_ns);
    return true;
}

/* ---- a nod ---- */

const char *gyro_self_test(struct gyro *b, int64_t t_ns)
{
    const char *why = NULL;
    if (b->run.mode != GYRO_NAVIGATE) why = "the self test is one of navigation: mode 6";
    else if (b->nod.way != GYRO_NOD_NONE) why = "a self test is under way";
    b->counters.refused += why != NULL;
    if (why) return why;
    b->nod = (struct gyro_nod){.way = GYRO_NOD_REST, .begun_ns = t_ns - NOD_REST_NS};
    return NULL;
}

/* There and back: the vehicle's own turn, as far as it is steady, drops out. A sensor that neither follows nor stays is one on
 * a vehicle that turns, or accelerates, and proves nothing. */
static void evaluate_nod(struct gyro *b, int64_t t_ns)
{
    struct gyro_nod *n = &b->nod;
    const double back_rad = gyro_wrap_rad(b->servo_rad - n->from_rad);
    const double nodded_rad = gyro_wrap_rad(n->top_rad - n->from_rad) - 0.5 * back_rad;
    const double want_rad = 1e-9 * (double)n->there_ns * n->rate_radps;
    const bool follows = fabs(nodded_rad - want_rad) < 0.5 * want_rad;
    n->nods++;
    n->stayed += fabs(nodded_rad) < 0.5 * want_rad && fabs(back_rad) < 0.5 * want_rad;
    n->begun_ns = t_ns;
    n->way = follows || n->nods == NODS ? GYRO_NOD_NONE : GYRO_NOD_REST;
    if (n->way != GYRO_NOD_NONE) return;
    n->result = follows ? GYRO_TEST_PASSED : n->stayed == NODS ? GYRO_TEST_FAILED : GYRO_TEST_UNCLEAR;
    if (n->result == GYRO_TEST_FAILED) gyro_report_encoder_fault(b, t_ns);
}

double gyro_nod_radps(struct gyro *b, int64_t t_ns)
{
    struct gyro_nod *n = &b->nod;
    const int64_t age_ns = t_ns - n->begun_ns;
    if (n->way == GYRO_NOD_REST && age_ns >= NOD_REST_NS) {
        const double most_radps = 0.5 * b->profile.torquer_limit_dps * RAD_PER_DEG;
        n->way = GYRO_NOD_THERE;
        n->begun_ns = t_ns;
        n->from_rad = b->servo_rad;
        n->rate_radps = fmin(NOD_RADPS, most_radps);
    } else if (n->way == GYRO_NOD_THERE && age_ns >= NOD_NS) {
        n->way = GYRO_NOD_BACK;
        n->begun_ns = t_ns;
        n->there_ns = age_ns;
        n->top_rad = b->servo_rad;
    } else if (n->way == GYRO_NOD_BACK && age_ns >= n->there_ns) {
        evaluate_nod(b, t_ns);
    }
    return n->way == GYRO_NOD_THERE ? n->rate_radps : n->way == GYRO_NOD_BACK ? -n->rate_radps : 0.0;
}
