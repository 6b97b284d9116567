#include "unit/boards.h"

#include <string.h>

#define TYPE(NAME)               &NAME##_board,
#define OWN_NAME(NAME)           {#NAME, &NAME##_board, NULL, NULL},
#define ALIAS(NAME, TYPE, TITLE) {#NAME, &TYPE##_board, #NAME, TITLE},

const struct board_type *const board_types[] = {BOARD_TYPES(TYPE) NULL};
const struct board_name board_names[] = {BOARD_TYPES(OWN_NAME) BOARD_ALIASES(ALIAS){NULL, NULL, NULL, NULL}};

const struct board_name *board_name_find(const char *name)
{
    for (const struct board_name *n = board_names; n->name; n++)
        if (strcmp(n->name, name) == 0) return n;
    return NULL;
}

const char *board_name_title(const struct board_name *n)
{
    return n->alias_title ? n->alias_title : n->type->title;
}

bool board_name_takes(const struct board_name *board, const struct board_name *profile)
{
    return board == profile || (board->type == profile->type && !board->profile);
}

const char *board_profile_name(const struct board_type *type, const void *profile)
{
    const struct field *f = fields_find(type->fields, "name");
    return f ? (const char *)profile + f->offset : type->profile_name;
}
