/* Who is out of work, and how it is calibrated (article section 3, figure 5): beats tau1..tau5. */
#include "board/pmka/internal.h"

/* Axis that K has in a beat; -1: none, K itself is out of work. What tau5 is for the text does not say: K rests (E0). */
static int axis_of_k(unsigned tau)
{
    return tau >= 2 && tau <= 4 ? (int)tau - 2 : -1;
}

void pmka_rotation_start(struct pmka *b)
{
    const struct pmka_profile *p = &b->profile;
    b->rotation = (struct pmka_rotation){
        .mode = (enum pmka_mode)p->rotation, .beat_periods = p->beat_periods, .zero_periods = p->zero_periods};
}

/* The period of the hand-over is for nothing, then zero, then resets, and a last one for the keys to move in peace. */
static enum pmka_cal planned_cal(const struct pmka_rotation *r)
{
    if (r->tau == 0) return PMKA_CAL_NONE;
    if (r->age <= r->zero_periods) return PMKA_CAL_ZERO;
    return r->age + 1 < r->beat_periods ? PMKA_CAL_RESET : PMKA_CAL_NONE;
}

void pmka_rotation_next(struct pmka *b)
{
    struct pmka_rotation *r = &b->rotation;
    r->age++;
    if (r->mode == PMKA_AUTONOMOUS) {
        r->cal = planned_cal(r);
        if (r->tau == 0 || r->age >= r->beat_periods) r->asked_tau = r->tau % PMKA_TAUS + 1;
    } else {
        r->cal = r->asked_tau == 0 && r->tau != 0 ? r->asked_cal : PMKA_CAL_NONE;
    }
}

bool pmka_rotation_turns(const struct pmka *b)
{
    return b->rotation.asked_tau != 0;
}

/* The key of K may be stuck: the controller does not know. */
static bool key_closes(const struct pmka *b, unsigned i)
{
    return !(i == PMKA_K && b->base.faults & PMKA_FAULT_STUCK_KEY);
}

static void put_key_line(struct pmka *b, unsigned i, int64_t t_ns)
{
    pmka_line(b, PMKA_LINE_KL1 + i, b->channel[i].axis >= 0, t_ns);
}

static void move_key(struct pmka *b, unsigned axis, unsigned from, unsigned to, int64_t t_ns)
{
    struct pmka_channel *f = &b->channel[from], *t = &b->channel[to];
    pmka_integrate(b, from, t_ns);
    pmka_integrate(b, to, t_ns);
    pmka_integrate_axis(b, axis, t_ns);
    pmka_probe(b, from, t_ns);
    pmka_probe(b, to, t_ns);
    f->axis = f->said_axis = -1;
    t->said_axis = (int)axis;
    t->axis = key_closes(b, to) ? (int)axis : -1;
    t->served = axis + 1;
    b->counters.handovers++;
    put_key_line(b, from, t_ns);
    put_key_line(b, to, t_ns);
}

void pmka_keys_home(struct pmka *b, int64_t t_ns)
{
    const int axis = b->channel[PMKA_K].said_axis;
    if (axis >= 0) move_key(b, (unsigned)axis, PMKA_K, (unsigned)axis, t_ns);
}

static void put_tau_lines(struct pmka *b, int64_t t_ns)
{
    for (unsigned n = 0; n < 3; n++) pmka_line(b, PMKA_LINE_TAU0 + n, b->rotation.tau >> n & 1u, t_ns);
}

void pmka_release_axis(struct pmka *b, int64_t t_ns)
{
    struct pmka_rotation *r = &b->rotation;
    r->tau = r->asked_tau;
    r->asked_tau = 0;
    r->age = 0;
    b->counters.beats++;
    board_notify(&b->base, PMKA_EV_TAU, t_ns);
    put_tau_lines(b, t_ns);
    pmka_keys_home(b, t_ns);
}

void pmka_take_axis(struct pmka *b, int64_t t_ns)
{
    const int axis = axis_of_k(b->rotation.tau);
    if (axis >= 0 && b->channel[PMKA_K].said_axis < 0) move_key(b, (unsigned)axis, (unsigned)axis, PMKA_K, t_ns);
}

void pmka_key_stuck(struct pmka *b, int64_t t_ns)
{
    struct pmka_channel *k = &b->channel[PMKA_K];
    if (k->said_axis < 0) return;
    pmka_integrate(b, PMKA_K, t_ns);
    pmka_integrate_axis(b, (unsigned)k->said_axis, t_ns);
    k->axis = key_closes(b, PMKA_K) ? k->said_axis : -1;
    put_key_line(b, PMKA_K, t_ns);
}

bool pmka_command(struct pmka *b, unsigned tau, enum pmka_cal cal)
{
    struct pmka_rotation *r = &b->rotation;
    if (r->mode != PMKA_PROGRAM || tau > PMKA_TAUS) return false;
    if (tau != 0 && tau != r->tau) r->asked_tau = tau;
    r->asked_cal = cal;
    return true;
}

void pmka_set_mode(struct pmka *b, enum pmka_mode mode)
{
    struct pmka_rotation *r = &b->rotation;
    if (mode == r->mode) return;
    r->mode = mode;
    r->asked_tau = 0;
    r->asked_cal = PMKA_CAL_NONE;
    r->age = 0;
}
