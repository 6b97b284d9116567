/* Board profiles that are built in: the names of proto/profiles, each "article" with its differences. */
#ifndef PSABENCH_API_PSA2_H
#define PSABENCH_API_PSA2_H

#include "board/psa2/profile.h"

#include <stdbool.h>
#include <stddef.h>

/* Number in the list of the option "profile". False with a sentence in why if it is not one a board can run. */
bool api_psa2_profile(unsigned number, struct psa2_profile *p, char *why, size_t cap);

#endif
