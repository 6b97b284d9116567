/* The lists as JSON, from the rows that the tables for people are made of. */
#include "app/list/list.h"
#include "control/control.h"
#include "control/describe.h"
#include "scenario/find.h"
#include "scenario/profile.h"
#include "scenario/scenario.h"
#include "scpi/scpi.h"

#include <stdlib.h>

static cJSON *add_named(cJSON *list, const char *key, const char *name)
{
    cJSON *j = add_object(list);
    cJSON_AddStringToObject(j, key, name);
    return j;
}

/* ---- files */

/* What a profile says of its board. A file that cannot be loaded has the reason in its place. */
static void add_profile(cJSON *j, const char *path)
{
    char text[512];
    const struct board_name *board;
    union board_profile_store p;
    if (!profile_yaml_load(path, &board, &p, text, sizeof text)) {
        cJSON_AddStringToObject(j, "error", text);
        return;
    }
    board->type->about(&p, text, sizeof text);
    cJSON_AddStringToObject(j, "profile", board_profile_name(board->type, &p));
    cJSON_AddStringToObject(j, "board", board_name_title(board));
    cJSON_AddStringToObject(j, "about", text);
}

static bool add_files(cJSON *to, const char *proto_folder, bool profiles, char *why, size_t cap)
{
    char folder[FIND_PATH_MAX], path[FIND_PATH_MAX + FIND_NAME_MAX + 8], comment[256];
    char(*names)[FIND_NAME_MAX];
    unsigned count;
    if (!find_proto_folder(proto_folder, folder, why, cap) || !find_names(folder, &names, &count, why, cap))
        return false;
    cJSON *list = cJSON_AddArrayToObject(to, proto_folder);
    for (unsigned i = 0; i < count; i++) {
        snprintf(path, sizeof path, "%s/%s.yaml", folder, names[i]);
        list_comment(path, comment, sizeof comment);
        cJSON *j = add_named(list, "name", names[i]);
        if (profiles) add_profile(j, path);
        cJSON_AddStringToObject(j, "what", comment);
    }
    free(names);
    return true;
}

static bool add_scenarios(cJSON *to, char *why, size_t cap)
{
    return add_files(to, "scenarios", false, why, cap);
}

static bool add_profiles(cJSON *to, char *why, size_t cap)
{
    return add_files(to, "profiles", true, why, cap);
}

/* ---- tables */

static bool add_commands(cJSON *to, char *why, size_t cap)
{
    (void)why, (void)cap;
    describe_rows(control_tables, cJSON_AddArrayToObject(to, "commands"));
    describe_rows(control_truth_tables, cJSON_AddArrayToObject(to, "truth_commands"));
    return true;
}

static void add_header(cJSON *list, const struct control_command *row, const struct control_scpi *how)
{
    cJSON *j = add_named(list, "header", how->header);
    cJSON_AddStringToObject(j, "command", row->name);
    if (how->result) cJSON_AddStringToObject(j, "returns", how->result);
    cJSON *args = how->result ? NULL : cJSON_AddArrayToObject(j, "args");
    for (unsigned i = scpi_suffixes(how->header); args && i < control_arg_count(row); i++)
        describe_arg(&row->arg[i], row->arg[i].optional, args);
    cJSON_AddStringToObject(j, "what", row->what);
}

static void add_instrument(cJSON *list, const struct scpi_kind *kind)
{
    cJSON *headers = cJSON_AddArrayToObject(add_named(list, "instrument", kind->name), "headers");
    const struct control_command *row;
    for (unsigned i = 0; (row = control_row(control_tables, i)); i++) {
        for (unsigned k = 0; scpi_belongs(kind, row) && k < CONTROL_SCPI_MAX && row->scpi[k].header; k++)
            add_header(headers, row, &row->scpi[k]);
    }
}

static bool add_scpi(cJSON *to, char *why, size_t cap)
{
    (void)why, (void)cap;
    cJSON *common = cJSON_AddArrayToObject(to, "common"), *kinds = cJSON_AddArrayToObject(to, "instruments");
    const struct scpi_command *row;
    for (unsigned i = 0; (row = scpi_common(i)); i++) {
        cJSON *j = add_named(common, "header", row->pattern);
        if (row->max) cJSON_AddNumberToObject(j, "max", row->max);
        cJSON_AddStringToObject(j, "what", row->what);
    }
    for (const struct scpi_kind *kind = scpi_kinds; kind->name; kind++) add_instrument(kinds, kind);
    return true;
}

static bool add_keys(cJSON *to, char *why, size_t cap)
{
    (void)why, (void)cap;
    scenario_add_keys(to);
    return true;
}

/* ---- faults */

static void add_kind(cJSON *list, const struct fault_kind *k)
{
    cJSON *j = add_object(list);
    describe_kind(k, j);
    if (k->unless) cJSON_AddStringToObject(j, "unless", k->unless);
    cJSON *places = cJSON_AddArrayToObject(j, "points");
    for (unsigned p = 0; p < FAULT_PLACES; p++) {
        if (k->places & FAULT_BIT(p))
            cJSON_AddItemToArray(places, cJSON_CreateString(fault_place_any((enum fault_place)p)));
    }
    describe_kind_args(k, j);
}

static void add_part(cJSON *list, const struct board_type *t, const struct board_part *part)
{
    cJSON *j = add_named(list, "part", part->name);
    cJSON *kinds = cJSON_AddArrayToObject(j, "kinds");
    const struct fault_kind *k;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) {
        if (list_part_has(t, part, k)) cJSON_AddItemToArray(kinds, cJSON_CreateString(k->name));
    }
    if (part->registers) cJSON_AddNumberToObject(j, "registers", part->registers);
    if (part->unless) cJSON_AddStringToObject(j, "unless", part->unless);
}

static void add_board(cJSON *list, const struct board_type *t)
{
    cJSON *j = add_named(list, "board", t->title);
    cJSON *parts = cJSON_AddArrayToObject(j, "parts"), *events = cJSON_AddArrayToObject(j, "events");
    for (unsigned i = 0; i < t->part_count; i++) {
        if (t->parts[i].name) add_part(parts, t, &t->parts[i]);
    }
    for (unsigned i = 0; i < t->event_count; i++) cJSON_AddItemToArray(events, cJSON_CreateString(t->events[i]));
}

static bool add_faults(cJSON *to, char *why, size_t cap)
{
    (void)why, (void)cap;
    cJSON *kinds = cJSON_AddArrayToObject(to, "kinds"), *boards = cJSON_AddArrayToObject(to, "boards");
    const struct fault_kind *k;
    for (unsigned i = 0; (k = fault_kind(i)) != NULL; i++) add_kind(kinds, k);
    for (const struct board_type *const *t = board_types; *t; t++) add_board(boards, *t);
    return true;
}

cJSON *list_json(enum options_action action, char *why, size_t cap)
{
    static bool (*const lists[])(cJSON * to, char *why, size_t cap) = {
        [OPTIONS_LIST_PROFILES] = add_profiles, [OPTIONS_LIST_SCENARIOS] = add_scenarios,
        [OPTIONS_LIST_COMMANDS] = add_commands, [OPTIONS_LIST_SCPI] = add_scpi,
        [OPTIONS_LIST_FAULTS] = add_faults,     [OPTIONS_LIST_KEYS] = add_keys,
    };
    cJSON *j = cJSON_CreateObject();
    if (lists[action](j, why, cap)) return j;
    cJSON_Delete(j);
    return NULL;
}
