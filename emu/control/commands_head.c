/* Commands of the dividing head. */
#include "control/commands.h"

static const char *const faces[] = {"direct", "reversed", "side", "side_reversed", NULL}; /* order of enum head_face */

static enum control_outcome do_read(const struct control_call *call)
{
    const struct head *h = &call->bench->lab->head;
    const int64_t rest_in_ns = head_at_rest(h, call->t_ns) ? 0 : head_rest_ns(h) - call->t_ns;
    cJSON_AddNumberToObject(call->result, "angle_deg", head_read_deg(h, call->t_ns));
    cJSON_AddStringToObject(call->result, "face", head_face_name(h->face));
    cJSON_AddBoolToObject(call->result, "at_rest", head_at_rest(h, call->t_ns));
    cJSON_AddNumberToObject(call->result, "rest_in_s", (double)rest_in_ns * 1e-9);
    return CONTROL_DONE;
}

static enum control_outcome do_turn(const struct control_call *call)
{
    struct head *h = &call->bench->lab->head;
    if (!head_at_rest(h, call->t_ns))
        return control_reject(call->control, "state", "the head is turning, at rest in %.3f s",
                              (double)(head_rest_ns(h) - call->t_ns) * 1e-9);
    control_settle_inputs(call->bench, call->t_ns);
    head_turn(h, call->v[0].real, call->t_ns);
    return do_read(call);
}

static enum control_outcome do_mount(const struct control_call *call)
{
    struct head *h = &call->bench->lab->head;
    if (!head_at_rest(h, call->t_ns)) return control_reject(call->control, "state", "the head is turning");
    control_settle_inputs(call->bench, call->t_ns);
    head_mount(h, (enum head_face)call->v[0].choice, call->t_ns);
    return do_read(call);
}

// clang-format off
static const struct control_command rows[] = {
    {"head.turn", "Turns the dividing head to an angle; takes turn_s of the scenario.",
     CONTROL_ARGS({"angle_deg", CONTROL_REAL, false, "deg", -3600, 3600, .what = "angle on the head's scale"}), .run = do_turn, .changes = true, .scpi = {{"ANGLe", NULL}}},
    {"head.mount", "Remounts the units on another face of the head's mount.",
     CONTROL_ARGS({"face", CONTROL_CHOICE, .what = "face of the mount", .choices = faces}), .run = do_mount, .changes = true, .scpi = {{"FACE", NULL}}},
    {"head.read", "Reads the head: angle, face, at rest or not, time until rest.", NULL, .run = do_read,
     .scpi = {{"ANGLe?", "angle_deg"}, {"FACE?", "face"}, {"REST?", "at_rest"}}},
};
// clang-format on
const struct control_table commands_head = {rows, sizeof rows / sizeof *rows};
