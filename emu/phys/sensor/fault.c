#include "phys/sensor/fault.h"

#include "base/sched.h"

#include <assert.h>
#include <math.h>
#include <stddef.h>

void sensor_fault_add(struct sensor_fault **list, struct sensor_fault *f)
{
    assert(f->kind < SENSOR_FAULTS);
    while (*list) list = &(*list)->next;
    f->next = NULL;
    *list = f;
}

void sensor_fault_remove(struct sensor_fault **list, struct sensor_fault *f)
{
    while (*list && *list != f) list = &(*list)->next;
    if (*list) *list = f->next;
}

static double noise_at(const struct sensor_fault *f, int64_t t_ns, int64_t every_ns)
{
    return looks_white_rms(f->value, every_ns) * draws_gauss(&f->noise, t_ns);
}

static double apply_fault(const struct sensor_fault *f, double out, int64_t t_ns, int64_t every_ns)
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
        return out + noise_at(f, t_ns, every_ns);
    default: /* SENSOR_SATURATION */
        return out < f->value ? f->value : out > f->value_high ? f->value_high : out;
    }
}

void sensor_fault_row(const struct sensor_fault *list, const struct looks *at, double *out)
{
    for (const struct sensor_fault *f = list; f; f = f->next)
        for (unsigned i = 0; i < at->n; i++)
            if (at->t_ns[i] >= f->from_ns) out[i] = apply_fault(f, out[i], at->t_ns[i], at->every_ns);
}
