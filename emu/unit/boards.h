/* Every type of board there is, their other names, and room for any of them. */
#ifndef PSABENCH_UNIT_BOARDS_H
#define PSABENCH_UNIT_BOARDS_H

#include "board/board.h"
#include "board/gyro/can.h"
#include "board/gyro/gyro.h"
#include "board/pik/can.h"
#include "board/pik/pik.h"
#include "board/pmka/can.h"
#include "board/pmka/pmka.h"
#include "board/psa2/can.h"
#include "board/psd1/can.h"
#include "board/psd1/psd1.h"

extern const struct board_type *const board_types[]; /* up to NULL */

/* A name that a scenario or a profile may use: a type's own, or another for one of its profiles. */
struct board_name {
    const char *name;
    const struct board_type *type;
    const char *profile; /* in proto/profiles; NULL: the type's default */
    const char *title;   /* "PIK-5" */
};
extern const struct board_name board_names[]; /* up to a NULL name; the types' own first */

const struct board_type *board_find(const char *name); /* a type by its own name; NULL: none */
const struct board_name *board_name_find(const char *name);

/* Whether a board of the one name can have a profile of the other: a type's own name takes any of the type. */
bool board_name_takes(const struct board_name *board, const struct board_name *profile);

/* The profile's field "name". */
const char *board_profile_name(const struct board_type *type, const void *profile);

union board_store {
    struct psa2 psa2;
    struct psd1 psd1;
    struct pmka pmka;
    struct pik pik;
    struct gyro gyro;
};

union board_can_store {
    struct psa2_can psa2;
    struct psd1_can psd1;
    struct pmka_can pmka;
    struct pik_can pik;
    struct gyro_can gyro;
};

union board_profile_store {
    struct psa2_profile psa2;
    struct psd1_profile psd1;
    struct pmka_profile pmka;
    struct pik_profile pik;
    struct gyro_profile gyro;
};

#endif
