/* Commands of the ring capture: what it waits for, and what it has written. */
#include "command/events.h"
#include "control/arm_text.h"
#include "control/commands.h"
#include "fault/fault.h"

#include <math.h>
#include <string.h>

enum { ON, PATH, UNIT, COUNT, PRE_S, POST_S, FILES, RING_MB, LIMIT_MB };

#define RING_MB_DEFAULT  24.0
#define LIMIT_MB_DEFAULT 1000.0

static int64_t ns_of(const struct control_value *v, double otherwise_s)
{
    return (int64_t)nearbyint((v->given ? v->real : otherwise_s) * 1e9);
}

static double real_of(const struct control_value *v, double otherwise)
{
    return v->given ? v->real : otherwise;
}

static bool find_line(const struct board_type *type, const char *name, unsigned *line, struct control_error *why)
{
    char known[480] = "";
    for (*line = 0; *line < type->line_count; ++*line) {
        if (strcmp(type->lines[*line].name, name) == 0) return true;
        why_list_add(known, sizeof known, type->lines[*line].name);
    }
    return control_expected(why, "range", "on", WHY_TEXT(name), "a line of a %s: %s", type->title, known);
}

/* What to wait for, with names found. False with the error. */
static bool resolve_arm(const struct control_bench *b, const struct control_value *v, struct control_arm *arm,
                        struct control_capture *c, struct control_error *why)
{
    struct arm_text text;
    if (!arm_text_parse(v[ON].text, &text, why)) return false;
    const unsigned unit = v[UNIT].unit;
    *arm = (struct control_arm){.unit = unit, .count = v[COUNT].given ? v[COUNT].count : 1};
    *c = (struct control_capture){.unit = unit, .when = text.when};
    if (!b->units) return control_reject_in(why, "state", "this bench has no unit");
    if (text.kind == ARM_LINE) return find_line(b->unit[unit]->type, text.name, &c->line, why);
    arm->on_event = text.kind == ARM_EVENT;
    arm->on_fault = text.kind == ARM_FAULT;
    if (arm->on_event) return control_event_find(b, unit, "on", text.name, &arm->event, why);
    arm->fault = text.name[0] ? fault_kind_find(text.name) : NULL;
    return !text.name[0] || arm->fault ||
           control_expected(why, "range", "on", WHY_TEXT(text.name), "a kind of fault that fault.kinds lists");
}

static bool check_arm(const struct control_bench *b, const struct control_value *v, struct control_error *why)
{
    struct control_arm arm;
    struct control_capture c;
    if (!resolve_arm(b, v, &arm, &c, why)) return false;
    if (c.when == CAPTURE_OUTSIDE || !v[COUNT].given) return true;
    return control_reject_in(why, "argument", "count: expected no count with a line");
}

static enum control_outcome do_arm(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    struct control_arm arm;
    struct control_capture c;
    if (!b->capture.arm) return control_reject(call->control, "state", "no captures on this bench");
    if (!check_arm(b, call->v, &call->control->error)) return CONTROL_REJECTED;
    (void)resolve_arm(b, call->v, &arm, &c, &call->control->error);
    c.path = call->v[PATH].text;
    c.pre_ns = ns_of(&call->v[PRE_S], 0.01);
    c.post_ns = ns_of(&call->v[POST_S], 0.01);
    c.files = call->v[FILES].given ? (uint32_t)call->v[FILES].count : 1;
    c.ring_bytes = (uint64_t)(real_of(&call->v[RING_MB], RING_MB_DEFAULT) * 1e6);
    c.max_bytes = (uint64_t)(real_of(&call->v[LIMIT_MB], LIMIT_MB_DEFAULT) * 1e6);
    if (!b->capture.arm(b->ctx, &c, call->control->error.why)) return control_failed(call->control, "state");
    control_watch_arm(call->control, &arm);
    return CONTROL_DONE;
}

static enum control_outcome do_disarm(const struct control_call *call)
{
    const struct control_bench *b = call->bench;
    if (!b->capture.disarm) return control_reject(call->control, "state", "no captures on this bench");
    if (!b->capture.disarm(b->ctx, call->control->error.why)) return control_failed(call->control, "state");
    control_watch_disarm(call->control);
    return CONTROL_DONE;
}

static enum control_outcome do_captures(const struct control_call *call)
{
    if (!call->bench->capture.describe) return control_reject(call->control, "state", "no captures on this bench");
    call->bench->capture.describe(call->bench->ctx, call->result);
    return CONTROL_DONE;
}

// clang-format off
static const struct control_command rows[] = {
    {"probe.arm", "Arms a capture: the latest edges of a unit's lines stay in a ring; a trigger writes them and what follows to a VCD file.",
     CONTROL_ARGS({"on", CONTROL_TEXT, .what = "trigger: fault[:KIND], event:NAME, line:NAME:rising, falling, edge, high or low"},
      {"path", CONTROL_TEXT, .what = "file to write, replaced if it exists; with files above 1, -1, -2, ... before its extension"},
      {"unit", CONTROL_UNIT, true, .what = "unit; default: the first"},
      {"count", CONTROL_COUNT, true, NULL, 1, CONTROL_COUNT_MAX, .what = "which fault or event triggers; default: 1", .def = 1},
      {"pre_s", CONTROL_REAL, true, "s", 0, 60, .what = "time before the trigger; default: 0.01", .def = 0.01},
      {"post_s", CONTROL_REAL, true, "s", 0, 86400, .what = "time after the trigger; default: 0.01", .def = 0.01},
      {"files", CONTROL_COUNT, true, NULL, 1, 1e6, .what = "number of captures; default: 1", .def = 1},
      {"ring_mb", CONTROL_REAL, true, "MB", 0.1, 1000, .what = "memory of the ring, 24 bytes an edge; default: 24", .def = RING_MB_DEFAULT},
      {"limit_mb", CONTROL_REAL, true, "MB", 0.1, 1e6, .what = "size at which a file ends; default: 1000", .def = LIMIT_MB_DEFAULT}),
     .run = do_arm, .check = check_arm},
    {"probe.disarm", "Ends the capture; a file that is being written ends 0.2 ms before now.", NULL, .run = do_disarm},
    {"probe.captures", "Reads the state of the capture and the latest 16 files with trigger, first and last instant.", NULL, .run = do_captures},
};
// clang-format on
const struct control_table commands_probe = {rows, sizeof rows / sizeof *rows};
