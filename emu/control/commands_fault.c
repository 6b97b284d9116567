/* Commands of faults: what there is, what is wrong now, and what is to go wrong. */
#include "control/commands.h"
#include "control/describe.h"
#include "fault/fault.h"

#include <string.h>

static bool check_add(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    struct fault f;
    return fault_make(b, v, &f, why);
}

static enum control_outcome do_add(const struct control_call *call)
{
    struct fault_engine *e = call->bench->faults;
    struct fault f;
    if (!e) return control_reject(call->control, "state", "no faults on this bench");
    if (!fault_make(call->bench, call->v, &f, &call->control->error)) return CONTROL_REJECTED;
    if (call->v[FAULT_AT_S].given && f.at_ns < call->t_ns) {
        return control_reject(call->control, "range", "at_s: expected at least %.10g s (now), got %.10g",
                              (double)call->t_ns * 1e-9, call->v[FAULT_AT_S].real);
    }
    const uint32_t id = fault_add(e, &f, call->t_ns);
    if (id == 0) {
        return control_reject(call->control, "state",
                              "expected up to %u faults, waiting or active; remove some with fault.clear", FAULTS_MAX);
    }
    cJSON_AddNumberToObject(call->result, "id", id);
    return CONTROL_DONE;
}

static enum control_outcome do_clear(const struct control_call *call)
{
    struct fault_engine *e = call->bench->faults;
    unsigned cleared = 0;
    if (!e) return control_reject(call->control, "state", "no faults on this bench");
    if (call->v[0].given && !fault_find(e, (uint32_t)call->v[0].count)) {
        return control_reject(call->control, "range", "id: expected an id that fault.list shows, got %llu",
                              (unsigned long long)call->v[0].count);
    }
    for (unsigned i = 0; i < FAULTS_MAX; i++) {
        struct fault *f = &e->fault[i];
        if (f->id == 0 || (call->v[0].given && f->id != call->v[0].count)) continue;
        fault_clear(e, f, call->t_ns);
        cleared++;
    }
    cJSON_AddNumberToObject(call->result, "cleared", cleared);
    return CONTROL_DONE;
}

/* ---- what there is */

void describe_kind(const struct fault_kind *k, cJSON *to)
{
    cJSON_AddStringToObject(to, "kind", k->name);
    cJSON_AddStringToObject(to, "what", k->what);
    cJSON_AddStringToObject(to, "seen", k->seen);
    cJSON_AddBoolToObject(to, "once", k->once);
}

void describe_kind_args(const struct fault_kind *k, cJSON *to)
{
    cJSON *args = cJSON_AddArrayToObject(to, "args");
    for (unsigned i = 0; i < FAULT_ARGS; i++) {
        if ((k->need | k->may) & FAULT_BIT(i)) describe_arg(&fault_args[i], !(k->need & FAULT_BIT(i)), args);
    }
}

static void add_kind(const struct control_bench *b, const struct fault_kind *k, cJSON *to)
{
    struct fault_names names;
    cJSON *j = add_object(to);
    describe_kind(k, j);
    cJSON *places = cJSON_AddArrayToObject(j, "points");
    fault_place_names(b, NULL, k->places, &names);
    for (unsigned i = 0; i < names.count; i++) cJSON_AddItemToArray(places, cJSON_CreateString(names.name[i]));
    describe_kind_args(k, j);
}

static enum control_outcome do_kinds(const struct control_call *call)
{
    cJSON *kinds = cJSON_AddArrayToObject(call->result, "kinds");
    const struct fault_kind *k;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) add_kind(call->bench, k, kinds);
    return CONTROL_DONE;
}

static enum control_outcome do_points(const struct control_call *call)
{
    cJSON *points = cJSON_AddArrayToObject(call->result, "points");
    struct fault_point p;
    char name[FAULT_POINT_MAX];
    const struct fault_kind *k = call->v[0].given ? fault_kind_find(call->v[0].text) : NULL;
    if (call->v[0].given && !k)
        return control_reject(call->control, "range", "kind: expected a name that fault.kinds lists, got \"%.40s\"",
                              call->v[0].text);
    for (struct fault_points at = {0}; fault_point_next(call->bench, &at, &p, name);) {
        if (!k || k->places & FAULT_BIT(p.place)) cJSON_AddItemToArray(points, cJSON_CreateString(name));
    }
    return CONTROL_DONE;
}

/* ---- what is wrong */

static void add_value(cJSON *to, const struct fault *f, enum fault_arg arg)
{
    const struct control_arg *a = &fault_args[arg];
    if (!fault_given(f, arg)) return;
    if (a->choices) cJSON_AddStringToObject(to, a->name, a->choices[(unsigned)f->value[arg]]);
    else cJSON_AddNumberToObject(to, a->name, f->value[arg]);
}

static void add_trigger(cJSON *to, const struct fault *f)
{
    const struct control_bench *b = f->engine->bench;
    const char *const *events = b->unit[f->unit]->type->events;
    cJSON_AddStringToObject(to, "after", events[f->trigger.after]);
    cJSON_AddNumberToObject(to, "count", f->trigger.count);
    if (f->trigger.since != FAULT_NO_EVENT) cJSON_AddStringToObject(to, "since", events[f->trigger.since]);
    cJSON_AddStringToObject(to, "unit", b->unit_name[f->unit]);
}

static void fault_describe(const struct fault *f, cJSON *to)
{
    cJSON_AddNumberToObject(to, "id", f->id);
    cJSON_AddStringToObject(to, "kind", f->kind->name);
    cJSON_AddStringToObject(to, "point", f->name);
    cJSON_AddStringToObject(to, "state", fault_state_name(f->state));
    add_value(to, f, FAULT_AT_S);
    if (f->trigger.after != FAULT_NO_EVENT) add_trigger(to, f);
    for (unsigned i = FAULT_DELAY_S; i < FAULT_ARGS; i++) add_value(to, f, (enum fault_arg)i);
    const bool begun = f->state == FAULT_ACTIVE || f->state == FAULT_OVER || f->state == FAULT_VOID;
    if (begun) cJSON_AddNumberToObject(to, "began_s", (double)f->began_ns * 1e-9);
    if (begun && f->state != FAULT_ACTIVE) cJSON_AddNumberToObject(to, "ended_s", (double)f->ended_ns * 1e-9);
}

static enum control_outcome do_list(const struct control_call *call)
{
    const struct fault_engine *e = call->bench->faults;
    cJSON *faults = cJSON_AddArrayToObject(call->result, "faults");
    const struct fault *next;
    for (uint32_t last = 0; e; last = next->id) { /* in order of their coming */
        next = NULL;
        for (unsigned i = 0; i < FAULTS_MAX; i++) {
            const struct fault *f = &e->fault[i];
            if (f->id > last && (!next || f->id < next->id)) next = f;
        }
        if (!next) break;
        fault_describe(next, add_object(faults));
    }
    return CONTROL_DONE;
}

// clang-format off
static const struct control_command rows[] = {
    {"fault.add", "Injects a fault now, at a time or after an event; see fault.kinds for its parameters.", fault_args, .run = do_add, .changes = true, .check = check_add},
    {"fault.clear", "Removes a fault, or all faults.", CONTROL_ARGS({"id", CONTROL_COUNT, true, NULL, 1, 4294967295.0, .what = "id from fault.add; default: all"}), .run = do_clear, .changes = true},
    {"fault.list", "Lists the faults with state: waiting (for its time), listening (for its event), active, over, void (could have no effect when it was due).", NULL, .run = do_list},
    {"fault.kinds", "Lists the kinds of faults: effect, symptom at the host, points, parameters.", NULL, .run = do_kinds},
    {"fault.points", "Lists the fault points of the bench.", CONTROL_ARGS({"kind", CONTROL_NAME, true, .what = "points for this kind; default: all"}), .run = do_points},
};
// clang-format on
const struct control_table commands_fault = {rows, sizeof rows / sizeof *rows};
