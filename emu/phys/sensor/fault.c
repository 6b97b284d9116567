#include "phys/sensor/fault.h"

#include "base/sched.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

#define FIRST_PULL_NS 31250 /* interval assumed before the first pull: one block of the converter at 1000 SPS */

void sensor_fault_add(struct sensor_fault **list, struct sensor_fault *f)
{
    assert(f->kind < SENSOR_FAULTS);
    while (*list) list = &(*list)->next;
    f->held = 0.0;
    f->held_ns = -1;
    f->next = NULL;
    *list = f;
}

void sensor_fault_remove(struct sensor_fault **list, struct sensor_fault *f)
{
    while (*list && *list != f) list = &(*list)->next;
    if (*list) *list = f->next;
}

/* White noise of one-sided density d, averaged over dt, has the variance d^2 / (2 dt), as in phys/sensor/mems.c. */
static double apply_noise(struct sensor_fault *f, double out, int64_t t_ns)
{
    const int64_t dt_ns = f->held_ns < 0 ? FIRST_PULL_NS : t_ns - f->held_ns;
    if (dt_ns > 0) {
        f->held = f->value * sqrt((double)NS_PER_S / (2.0 * (double)dt_ns)) * rng_gauss(&f->noise);
        f->held_ns = t_ns;
    }
    return out + f->held;
}

static double apply_fault(struct sensor_fault *f, double out, int64_t t_ns)
{
    switch (f->kind) {
    case SENSOR_STUCK:
        return f->value;
    case SENSOR_BIAS:
        return out + f->value;
    case SENSOR_DRIFT:
        return out + f->value * ((double)(t_ns - f->from_ns) / (double)NS_PER_S);
    case SENSOR_SCALE:
        return out + f->value * (out - f->zero);
    case SENSOR_NOISE:
        return apply_noise(f, out, t_ns);
    default: /* SENSOR_SATURATION */
        return out < f->value ? f->value : out > f->value_high ? f->value_high : out;
    }
}

double sensor_fault_out(struct sensor_fault *list, double out, int64_t t_ns)
{
    for (struct sensor_fault *f = list; f; f = f->next) {
        if (t_ns >= f->from_ns) out = apply_fault(f, out, t_ns);
    }
    return out;
}
