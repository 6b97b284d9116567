/* Commands of the dividing head. */
#include "control/commands.h"

static const char *const faces[] = {"direct", "reversed", "side", "side_reversed", NULL}; /* order of enum head_face */

static void add_head(const struct head *h, cJSON *result, int64_t t_ns)
{
    const bool rest = head_at_rest(h, t_ns);
    cJSON_AddNumberToObject(result, "angle_deg", head_read_deg(h, t_ns));
    cJSON_AddStringToObject(result, "face", head_face_name(h->face));
    cJSON_AddBoolToObject(result, "at_rest", rest);
    cJSON_AddNumberToObject(result, "rest_in_s", rest ? 0.0 : (double)(head_rest_ns(h) - t_ns) * 1e-9);
}

static enum control_outcome do_turn(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!head_at_rest(&c->bench->lab->head, t_ns)) {
        return control_reject(c, "state", "the head is turning, at rest in %.3f s",
                              (double)(head_rest_ns(&c->bench->lab->head) - t_ns) * 1e-9);
    }
    control_settle_inputs(c->bench, t_ns);
    head_turn(&c->bench->lab->head, v[0].real, t_ns);
    add_head(&c->bench->lab->head, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_mount(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    if (!head_at_rest(&c->bench->lab->head, t_ns)) return control_reject(c, "state", "the head is turning");
    control_settle_inputs(c->bench, t_ns);
    head_mount(&c->bench->lab->head, (enum head_face)v[0].choice, t_ns);
    add_head(&c->bench->lab->head, result, t_ns);
    return CONTROL_DONE;
}

static enum control_outcome do_read(struct control *c, const struct control_value *v, cJSON *result, int64_t t_ns)
{
    (void)v;
    add_head(&c->bench->lab->head, result, t_ns);
    return CONTROL_DONE;
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
