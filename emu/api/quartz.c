/* Quartz accelerometers of a production batch in a chamber, without a board: run-in by thermal cycles. */
#include "api/psabench_models.h"
#include "base/looks.h"
#include "base/sched.h"
#include "phys/chamber.h"
#include "phys/sensor/quartz_batch.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

enum { BATCH_NUMBERS = 33, QUANTITIES = 3 };

#define SETTLE_NS (10 * NS_PER_S) /* from a turn to its reading: the loop answers in 5 ms */

_Static_assert(sizeof(struct quartz_batch) - offsetof(struct quartz_batch, share_a) == BATCH_NUMBERS * sizeof(double),
               "the batch is its name and BATCH_NUMBERS doubles");

/* g along the unit's axes, as psabench_quartz_run_in() lists them */
static const double positions[PSABENCH_QUARTZ_POSITIONS][3] = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};

/* One accelerometer in a chamber of its own. */
struct oven {
    struct chamber chamber;
    struct chamber_body body;
    struct chamber_play play;
    struct quartz q;
    double g_mps2;
    int64_t t_ns;
};

/* Its temperatures and cycles are those of now. */
static void warm_sensor(struct oven *o)
{
    o->q.case_degc = chamber_case_degc(&o->chamber, &o->body, o->t_ns);
    o->q.element_degc = chamber_element_degc(&o->chamber, &o->body, o->t_ns);
    o->q.felt_degc = chamber_felt_degc(&o->chamber, &o->body, &o->play, o->t_ns);
    o->q.cycles = chamber_body_cycles(&o->chamber, &o->body, o->t_ns);
}

/* Looks over dt_ns, the last at its end. */
static void look_row(struct oven *o, const double g[3], int64_t dt_ns, unsigned n, double *out_a)
{
    const double a_mps2[3] = {g[0] * o->g_mps2, g[1] * o->g_mps2, g[2] * o->g_mps2};
    int64_t t_ns[LOOKS_MAX];
    for (unsigned i = 0; i < n; i++) t_ns[i] = o->t_ns + dt_ns * (i + 1) / n;
    const struct looks at = {t_ns, n, dt_ns / n};
    quartz_out_row_a(&o->q, a_mps2, 1, &at, out_a);
    o->t_ns += dt_ns;
}

/* To a temperature, and a while there. */
static bool go_to(struct oven *o, double degc, double soak_min)
{
    if (chamber_set(&o->chamber, degc, o->t_ns) != CHAMBER_OK) return false;
    o->t_ns = chamber_stable_ns(&o->chamber) + (int64_t)(soak_min * 60.0 * (double)NS_PER_S);
    warm_sensor(o);
    return true;
}

/* Mean of a position's looks, and the standard deviation of that mean. */
static void read_position(struct oven *o, const double g[3], double reading_s, double *mean_a, double *sd_a)
{
    double a[LOOKS_MAX], sum = 0.0, square = 0.0;
    look_row(o, g, SETTLE_NS, 1, a);
    look_row(o, g, (int64_t)(reading_s * (double)NS_PER_S), LOOKS_MAX, a);
    for (unsigned i = 0; i < LOOKS_MAX; i++) sum += a[i];
    *mean_a = sum / LOOKS_MAX;
    for (unsigned i = 0; i < LOOKS_MAX; i++) square += (a[i] - *mean_a) * (a[i] - *mean_a);
    *sd_a = sqrt(square / (LOOKS_MAX - 1.0) / LOOKS_MAX);
}

/* A start, the readings of all positions, and what is true of them. */
static void read_start(struct oven *o, const struct psabench_quartz_job *job, double *mean_a, double *sd_a,
                       double *truth)
{
    quartz_start(&o->q);
    for (unsigned i = 0; i < PSABENCH_QUARTZ_POSITIONS; i++)
        read_position(o, positions[i], job->reading_s, &mean_a[i], &sd_a[i]);
    if (!truth) return;
    truth[0] = o->q.terms.zero_ug;
    truth[1] = o->q.terms.scale_a_per_g;
    truth[2] = o->q.terms.tilt_y_mrad;
}

/* The unit as scenario quartz_chamber has it on its x axis: built from its pendulum, the rest from the batch. */
static bool put_in(struct oven *o, const struct psabench_quartz_job *job, const struct quartz_batch *b, uint32_t serial)
{
    struct chamber_cfg c = chamber_default();
    struct quartz_g g = quartz_default();
    c.present = true;
    c.start_degc = job->read_degc;
    c.ramp_k_per_min = job->ramp_k_per_min;
    g.pendulum_given = true;
    g.noise_a_rthz = job->noise_a_rthz;
    g.play_k = job->play_k;
    g = quartz_with_pendulum(&g, job->g_mps2);
    if (!quartz_batch_draw(b, job->seed, serial, 0, &g)) return false;
    *o = (struct oven){.g_mps2 = job->g_mps2};
    chamber_init(&o->chamber, &c);
    chamber_put_in(&o->chamber, &o->body, 0.0, 0.0);
    chamber_play_add(&o->body, &o->play, g.play_k);
    quartz_init(&o->q, &g, job->g_mps2, draws_of(job->seed, serial, "quartz.x"),
                draws_of(job->seed, serial, "quartz.start.x"));
    warm_sensor(o);
    return true;
}

/* Rows of one unit: a row a start. */
static bool run_unit(const struct psabench_quartz_job *job, const struct quartz_batch *b, uint32_t unit, double *mean_a,
                     double *sd_a, double *truth)
{
    struct oven o;
    if (!put_in(&o, job, b, job->first_serial + unit)) return false;
    for (uint32_t n = 0; n <= job->cycles; n++) {
        if (n > 0 && !(go_to(&o, job->cold_degc, job->soak_min) && go_to(&o, job->hot_degc, job->soak_min) &&
                       go_to(&o, job->read_degc, job->rest_min)))
            return false;
        read_start(&o, job, mean_a, sd_a, truth);
        mean_a += PSABENCH_QUARTZ_POSITIONS;
        sd_a += PSABENCH_QUARTZ_POSITIONS;
        if (truth) truth += QUANTITIES;
    }
    return true;
}

static bool is_within(double value, double least, double most)
{
    return value >= least && value <= most; /* not a number: no */
}

static bool job_fits(const struct psabench_quartz_job *j)
{
    return j->size == sizeof *j && j->cycles <= PSABENCH_QUARTZ_CYCLES_MAX &&
           is_within(j->ramp_k_per_min, CHAMBER_RAMP_MIN_K_PER_MIN, 5.0) && is_within(j->soak_min, 0.0, 1e4) &&
           is_within(j->rest_min, 0.0, 1e4) && is_within(j->reading_s, 1e-3, 1e4) && is_within(j->g_mps2, 1.0, 100.0) &&
           is_within(j->noise_a_rthz, 0.0, 1.0) && is_within(j->play_k, 0.0, 100.0);
}

int psabench_quartz_run_in(const struct psabench_quartz_job *job, const double *batch, size_t numbers, double *mean_a,
                           double *sd_a, double *truth)
{
    struct quartz_batch b = quartz_batch_default();
    if (!job || !mean_a || !sd_a || !job_fits(job) || (batch && numbers != BATCH_NUMBERS)) return PSABENCH_BAD_ARGUMENT;
    if (batch) memcpy((char *)&b + offsetof(struct quartz_batch, share_a), batch, BATCH_NUMBERS * sizeof *batch);
    const size_t starts = (size_t)job->cycles + 1;
    for (uint32_t i = 0; i < job->units; i++) {
        double *const true_row = truth ? truth + i * starts * QUANTITIES : NULL;
        const size_t row = i * starts * PSABENCH_QUARTZ_POSITIONS;
        if (!run_unit(job, &b, i, mean_a + row, sd_a + row, true_row)) return PSABENCH_BAD_ARGUMENT;
    }
    return PSABENCH_OK;
}
