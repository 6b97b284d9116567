#include "phys/sensor/series.h"

enum { NEAR = 4 }; /* samples that are passed one by one before the place is searched for */

/* The last sample at or before t_ns, which is not before the first. */
static size_t search_place(const struct series *s, int64_t t_ns)
{
    size_t low = 0, high = s->count;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        if (s->sample[middle].t_ns <= t_ns) low = middle;
        else high = middle;
    }
    return low;
}

static size_t find_place(struct series *s, int64_t t_ns)
{
    size_t i = s->place;
    if (s->sample[i].t_ns > t_ns) return s->place = search_place(s, t_ns);
    for (unsigned k = 0; k < NEAR; k++, i++)
        if (i + 1 == s->count || s->sample[i + 1].t_ns > t_ns) return s->place = i;
    return s->place = search_place(s, t_ns);
}

/* How long the last sample lasts where the series is repeated. */
static int64_t last_interval_ns(const struct series *s)
{
    return s->sample[s->count - 1].t_ns - s->sample[s->count - 2].t_ns;
}

/* Into the first pass of a series that is repeated. */
static int64_t folded_ns(const struct series *s, int64_t t_ns)
{
    const int64_t first_ns = s->sample[0].t_ns;
    const int64_t period_ns = s->sample[s->count - 1].t_ns - first_ns + last_interval_ns(s);
    return t_ns < first_ns ? t_ns : first_ns + (t_ns - first_ns) % period_ns;
}

static double on_line(const struct series_sample *a, int64_t dt_ns, double next, int64_t t_ns)
{
    return a->value + (next - a->value) * ((double)(t_ns - a->t_ns) / (double)dt_ns);
}

bool series_value(struct series *s, int64_t t_ns, double *value)
{
    const size_t last = s->count - 1;
    int64_t at_ns = t_ns - s->start_ns;
    if (s->end == SERIES_END_REPEAT) at_ns = folded_ns(s, at_ns);
    if (s->end == SERIES_END_STOP && at_ns > s->sample[last].t_ns) return false;
    if (at_ns < s->sample[0].t_ns) at_ns = s->sample[0].t_ns;
    const size_t i = find_place(s, at_ns);
    const struct series_sample *a = &s->sample[i];
    *value = a->value;
    if (s->between == SERIES_HOLD) return true;
    if (i < last) *value = on_line(a, a[1].t_ns - a->t_ns, a[1].value, at_ns);
    else if (s->end == SERIES_END_REPEAT) *value = on_line(a, last_interval_ns(s), s->sample[0].value, at_ns);
    return true;
}
