#include "unit/boards.h"

#include "board/gyro/board.h"
#include "board/pik/board.h"
#include "board/pmka/board.h"
#include "board/psa2/board.h"
#include "board/psd1/board.h"

#include <string.h>

const struct board_type *const board_types[] = {&psa2_board, &psd1_board, &pmka_board, &pik_board, &gyro_board, NULL};

const struct board_name board_names[] = {
    {"psa2", &psa2_board, NULL, "PSA-2"},
    {"psd1", &psd1_board, NULL, "PSD-1"},
    {"pmka", &pmka_board, NULL, "PMKA"},
    {"pik", &pik_board, NULL, "PIK"},
    {"gyro", &gyro_board, NULL, "Gyro unit"},
    {"psa1", &psa2_board, "psa1", "PSA-1"},
    {"pik5", &pik_board, "pik5", "PIK-5"},
    {"pik6", &pik_board, "pik6", "PIK-6"},
    {NULL, NULL, NULL, NULL},
};

const struct board_type *board_find(const char *name)
{
    for (unsigned i = 0; board_types[i]; i++)
        if (strcmp(board_types[i]->name, name) == 0) return board_types[i];
    return NULL;
}

const struct board_name *board_name_find(const char *name)
{
    for (const struct board_name *n = board_names; n->name; n++)
        if (strcmp(n->name, name) == 0) return n;
    return NULL;
}

bool board_name_takes(const struct board_name *board, const struct board_name *profile)
{
    return board == profile || (board->type == profile->type && !board->profile);
}

const char *board_profile_name(const struct board_type *type, const void *profile)
{
    const struct board_field *f = board_field_find(type->fields, type->field_count, "name");
    return f ? (const char *)profile + f->offset : type->profile_name;
}
