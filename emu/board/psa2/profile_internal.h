/* What the files of the profile share: the sequences of its field table. Not for others. */
#ifndef PSABENCH_BOARD_PSA2_PROFILE_INTERNAL_H
#define PSABENCH_BOARD_PSA2_PROFILE_INTERNAL_H

#include "board/psa2/profile.h"

/* board_field.parse and .text */
bool psa2_parse_word(void *profile, unsigned i, const char *text);
bool psa2_word_text(const void *profile, unsigned i, char *out, size_t cap);
bool psa2_parse_step(void *profile, unsigned i, const char *text);
bool psa2_step_text(const void *profile, unsigned i, char *out, size_t cap);

#endif
