/* Which faults are rejected, and why: the kind, the point, the values, the instant. */
#include "fault/internal.h"

#include "base/why.h"
#include "command/args.h"
#include "command/events.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* ---- kind and point */

static bool find_kind(const char *name, const struct fault_kind **kind, struct control_error *why)
{
    char known[160] = "";
    const struct fault_kind *k;
    *kind = fault_kind_find(name);
    if (*kind) return true;
    const char *dot = strchr(name, '.');
    const size_t layer = dot ? (size_t)(dot - name) + 1 : 0;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        if (layer && strncmp(k->name, name, layer) == 0) why_list_add(known, sizeof known, k->name);
    }
    if (!known[0]) return control_expected(why, "range", "kind", WHY_TEXT(name), "a name that fault.kinds lists");
    return control_expected(why, "range", "kind", WHY_TEXT(name), "one of %s", known);
}

static bool find_point(const struct control_bench *b, const char *text, struct fault *f, struct control_error *why)
{
    if (fault_point_find(b, text, &f->point, f->name)) return true;
    return control_expected(why, "range", "point", WHY_TEXT(text), "a name that fault.points lists");
}

static bool has_unit(enum fault_place place)
{
    return place < FAULT_AT_BUS;
}

/* Where a kind works, in the names of the board that the point is on, or of the boards that there are. */
static void join_places(const struct control_bench *b, const struct fault *f, char *out, size_t cap)
{
    struct fault_names names;
    fault_place_names(b, has_unit(f->point.place) ? b->unit[f->point.unit]->type : NULL, f->kind->places, &names);
    for (unsigned i = 0; i < names.count; i++) why_list_add(out, cap, names.name[i]);
}

bool fault_fits(const struct control_bench *b, const struct fault *f, char *why)
{
    char places[120] = "";
    if (f->kind->places & FAULT_BIT(f->point.place)) return !f->kind->fits || f->kind->fits(b, f, why);
    join_places(b, f, places, sizeof places);
    if (!places[0]) snprintf(places, sizeof places, "another board");
    return why_fail(why, CONTROL_WHY_MAX, "%s: expected a point on %s, got %s, which is %s", f->kind->name, places,
                    f->name, fault_place_what(f->point.place));
}

/* ---- values */

static int64_t ns_of_s(double s)
{
    return (int64_t)nearbyint(s * (double)NS_PER_S);
}

/* Whether the values are those of its kind. */
static bool values_fit(const struct fault *f, struct control_error *why)
{
    const struct fault_kind *k = f->kind;
    for (unsigned i = FAULT_FOR_S; i < FAULT_ARGS; i++) {
        const char *name = fault_args[i].name;
        const bool given = fault_given(f, (enum fault_arg)i);
        if (given && i != FAULT_FOR_S && !((k->need | k->may) & FAULT_BIT(i))) {
            return control_reject_in(why, "argument", "%s: not an argument of %s", name, k->name);
        }
        if (!given && (k->need & FAULT_BIT(i))) {
            return control_expected(why, "argument", name, "nothing", "a value (%s)", fault_args[i].what);
        }
        if (given && (k->nonzero & FAULT_BIT(i)) && f->value[i] == 0.0) {
            return control_expected(why, "range", name, "0", "a value other than 0");
        }
        if ((i == FAULT_FOR_S || i == FAULT_HOLD_S) && f->value[i] > 0.0 && ns_of_s(f->value[i]) == 0) {
            return control_expected(why, "range", name, WHY_REAL(f->value[i]), "0 or at least 1e-9 s");
        }
    }
    return !k->once || !fault_given(f, FAULT_FOR_S) ||
           control_reject_in(why, "argument", "for_s: %s is instantaneous and takes no duration", k->name);
}

/* ---- when */

static bool find_event(const struct control_bench *b, unsigned unit, const struct control_value *v, const char *arg,
                       int *event, struct control_error *why)
{
    unsigned number;
    *event = FAULT_NO_EVENT;
    if (!v->given) return true;
    if (!control_event_find(b, unit, arg, v->text, &number, why)) return false;
    *event = (int)number;
    return true;
}

static bool set_trigger(const struct control_bench *b, const struct control_value *v, struct fault *f,
                        struct control_error *why)
{
    static const enum fault_arg of_events[] = {FAULT_COUNT, FAULT_SINCE, FAULT_UNIT, FAULT_DELAY_S};
    int after, since;
    f->trigger.after = FAULT_NO_EVENT;
    f->unit = v[FAULT_UNIT].given ? v[FAULT_UNIT].unit : f->point.unit;
    for (unsigned i = 0; !v[FAULT_AFTER].given && i < sizeof of_events / sizeof *of_events; i++) {
        const char *name = fault_args[of_events[i]].name;
        if (v[of_events[i]].given)
            return control_reject_in(why, "argument", "%s: requires after, the name of an event", name);
    }
    if (!v[FAULT_AFTER].given) return true;
    if (!v[FAULT_UNIT].given && !has_unit(f->point.place) && b->units != 1)
        return control_expected(why, "argument", "unit", "nothing", "the unit whose events count");
    if (!find_event(b, f->unit, &v[FAULT_AFTER], "after", &after, why)) return false;
    if (!find_event(b, f->unit, &v[FAULT_SINCE], "since", &since, why)) return false;
    if (after == since) return control_expected(why, "range", "since", "the event of after", "another event");
    f->trigger = fault_trigger(after, since, v[FAULT_COUNT].given ? (unsigned)v[FAULT_COUNT].count : 1);
    return true;
}

bool fault_make(const struct control_bench *b, const struct control_value *v, struct fault *out,
                struct control_error *why)
{
    memset(out, 0, sizeof *out);
    for (unsigned i = 0; i < FAULT_ARGS; i++) {
        if (!v[i].given) continue;
        out->given |= FAULT_BIT(i);
        out->value[i] = i == FAULT_LEVEL ? (double)v[i].choice : v[i].real;
    }
    out->at_ns = ns_of_s(out->value[FAULT_AT_S]);
    out->delay_ns = ns_of_s(out->value[FAULT_DELAY_S]);
    out->for_ns = ns_of_s(out->value[FAULT_FOR_S]);
    if (!find_kind(v[FAULT_KIND].text, &out->kind, why) || !find_point(b, v[FAULT_POINT].text, out, why)) return false;
    if (!set_trigger(b, v, out, why)) return false;
    why->code = "point";
    if (!(out->kind->places & FAULT_BIT(out->point.place))) return fault_fits(b, out, why->why);
    if (!values_fit(out, why)) return false;
    why->code = "point";
    return fault_fits(b, out, why->why);
}
