/* Faults of a satellite receiver (board_type.receiver). Those of a kind add up: the receiver is given the sum of what is active. */
#include "base/detmath.h"
#include "base/why.h"
#include "fault/internal.h"

#include <math.h>

enum { OUTAGE, SPOOF, JUMP, FROZEN_TIME, BAD_CHECKSUM, WRONG_WEEK };

/* East and north of so much towards the azimuth. */
static void add_towards(const struct fault *f, double size, double to[2])
{
    const struct det_pair azimuth = det_sin_cos(f->value[FAULT_AZIMUTH_DEG] * RAD_PER_DEG);
    to[0] += size * azimuth.sin;
    to[1] += size * azimuth.cos;
}

static void add_spoof(const struct fault *f, struct board_receiver_faults *sum, int64_t t_ns)
{
    add_towards(f, f->value[FAULT_RAMP_MPS], sum->rate_mps);
    add_towards(f, f->value[FAULT_RAMP_MPS] * sched_since_s(f->began_ns, t_ns), sum->base_m);
}

/* Each of them spoils a message by itself. */
static void add_checksum(const struct fault *f, struct board_receiver_faults *sum)
{
    const double p = fault_given(f, FAULT_PROBABILITY) ? f->value[FAULT_PROBABILITY] : 1.0;
    sum->checksum_probability = 1.0 - (1.0 - sum->checksum_probability) * (1.0 - p);
}

static void add_to_sum(const struct fault *f, struct board_receiver_faults *sum, int64_t t_ns)
{
    switch (f->kind->variant) {
    case OUTAGE:
        sum->outage = true;
        break;
    case SPOOF:
        add_spoof(f, sum, t_ns);
        break;
    case JUMP:
        add_towards(f, f->value[FAULT_JUMP_M], sum->jump_m);
        break;
    case FROZEN_TIME:
        sum->frozen_time = true;
        break;
    case BAD_CHECKSUM:
        add_checksum(f, sum);
        break;
    default:
        sum->weeks += (int32_t)f->value[FAULT_WEEKS];
    }
}

static void refresh_receiver(struct fault *f, int64_t t_ns)
{
    const struct unit *u = fault_unit(f);
    struct board_receiver_faults sum = {.weeks = 0};
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        const struct fault *other = &f->engine->fault[i];
        const bool of_table = other->id != 0 && other->kind->lift == refresh_receiver; /* frozen_words is not */
        if (of_table && fault_lasts_at(f, other)) add_to_sum(other, &sum, t_ns);
    }
    u->type->receiver->set_faults(u->board, &sum, t_ns);
}

static bool is_receiver(const struct control_bench *b, const struct fault *f, char *why)
{
    return b->unit[f->point.unit]->type->receiver ||
           why_fail(why, CONTROL_WHY_MAX, "%s: expected a satellite receiver, got a %s", f->name,
                    b->unit[f->point.unit]->type->title);
}

static bool has_whole_weeks(const struct control_bench *b, const struct fault *f, char *why)
{
    const double weeks = f->value[FAULT_WEEKS];
    if (!is_receiver(b, f, why)) return false;
    return weeks == nearbyint(weeks) || why_fail(why, CONTROL_WHY_MAX, "weeks: expected whole weeks, got %.10g", weeks);
}

// clang-format off
#define RECEIVER(v) .variant = (v), .places = FAULT_BIT(FAULT_AT_CONTROLLER), .lift = refresh_receiver, .unless = "the board is no receiver", \
     .fits = is_receiver, .lacks = "this board is no satellite receiver"
static const struct fault_kind receiver[] = {
    {"receiver.outage", "The receiver has no fix.", "FIX 0 on CAN; status V and empty fields in the sentences, fixType 0 in PVT; time goes on",
     RECEIVER(OUTAGE)},
    {"receiver.spoof", "The position runs away at ramp_mps towards azimuth_deg, as if the receiver had followed a counterfeit signal.", "position and velocity agree with each other, FIX stays 3; both leave what is true",
     RECEIVER(SPOOF), .need = FAULT_BIT(FAULT_RAMP_MPS), .may = FAULT_BIT(FAULT_AZIMUTH_DEG), .nonzero = FAULT_BIT(FAULT_RAMP_MPS)},
    {"receiver.jump", "The position is off by jump_m towards azimuth_deg.", "a step from one solution to the next, without a velocity that explains it",
     RECEIVER(JUMP), .need = FAULT_BIT(FAULT_JUMP_M), .may = FAULT_BIT(FAULT_AZIMUTH_DEG), .nonzero = FAULT_BIT(FAULT_JUMP_M)},
    {"receiver.frozen_time", "The time of the solutions stands still.", "TOW and UTC repeat, SEQ and position go on",
     RECEIVER(FROZEN_TIME)},
    {"receiver.bad_checksum", "Messages of the serial port have a wrong checksum, each with the given probability.", "sentences and packets that a parser rejects; CAN is unaffected",
     RECEIVER(BAD_CHECKSUM), .may = FAULT_BIT(FAULT_PROBABILITY)},
    {"receiver.wrong_week", "The date is off by weeks.", "WEEK and the date differ by weeks, TOW and the time of day do not",
     .variant = WRONG_WEEK, .places = FAULT_BIT(FAULT_AT_CONTROLLER), .lift = refresh_receiver, .unless = "the board is no receiver; weeks is no whole number",
     .fits = has_whole_weeks, .lacks = "this board is no satellite receiver",
     .need = FAULT_BIT(FAULT_WEEKS), .nonzero = FAULT_BIT(FAULT_WEEKS)},
};
// clang-format on
const struct fault_table fault_receiver = {receiver, sizeof receiver / sizeof *receiver};
