/* Every type of board there is, their other names, and room for any of them. */
#ifndef PSABENCH_UNIT_BOARDS_H
#define PSABENCH_UNIT_BOARDS_H

#include "board/bins/board.h"
#include "board/gyro/board.h"
#include "board/pik/board.h"
#include "board/pmka/board.h"
#include "board/psa2/board.h"
#include "board/psd1/board.h"
#include "board/receiver/board.h"

/* The types, the default one first. X(NAME): board/NAME/board.h has struct NAME, struct NAME_can, struct NAME_profile and the
 * board_type NAME_board. */
#define BOARD_TYPES(X) X(psa2) X(psd1) X(pmka) X(pik) X(gyro) X(bins) X(receiver)

/* Other names for a type with one of its profiles. X(name, type, title); the profile is proto/profiles/<name>.yaml. */
#define BOARD_ALIASES(X) X(psa1, psa2, "PSA-1") X(pik5, pik, "PIK-5") X(pik6, pik, "PIK-6")

extern const struct board_type *const board_types[]; /* up to NULL */

/* A name that a scenario or a profile may use: a type's own, or another for one of its profiles. */
struct board_name {
    const char *name;
    const struct board_type *type;
    const char *profile;     /* in proto/profiles; NULL: the type's default */
    const char *alias_title; /* "PIK-5"; NULL: the type's */
};
extern const struct board_name board_names[]; /* up to a NULL name; the types' own first */

const struct board_name *board_name_find(const char *name);
const char *board_name_title(const struct board_name *n);

/* Whether a board of the one name can have a profile of the other: a type's own name takes any of the type. */
bool board_name_takes(const struct board_name *board, const struct board_name *profile);

/* The profile's field "name". */
const char *board_profile_name(const struct board_type *type, const void *profile);

#define BOARD_STORE(NAME)         struct NAME NAME;
#define BOARD_CAN_STORE(NAME)     struct NAME##_can NAME;
#define BOARD_PROFILE_STORE(NAME) struct NAME##_profile NAME;
union board_store {
    BOARD_TYPES(BOARD_STORE)
};
union board_can_store {
    BOARD_TYPES(BOARD_CAN_STORE)
};
union board_profile_store {
    BOARD_TYPES(BOARD_PROFILE_STORE)
};

#endif
