/* Pages of the documentation that repeat a table of the program. */
#ifndef PSABENCH_TESTS_PAGE_H
#define PSABENCH_TESTS_PAGE_H

#include "rig.h"

#include <stdio.h>
#include <string.h>

/* Whether the page, a file of the repository, has this line. */
static inline bool page_has(const char *path, const char *line)
{
    char got[2048];
    FILE *page = fopen(path, "r");
    if (!page) skip(); /* not run in the root of the repository */
    bool found = false;
    while (!found && fgets(got, sizeof got, page)) {
        got[strcspn(got, "\n")] = '\0';
        found = strcmp(got, line) == 0;
    }
    fclose(page);
    return found;
}

/* The next line of a table that the program wrote; false past the last. */
static inline bool next_line(FILE *table, char *line, size_t cap)
{
    if (!fgets(line, (int)cap, table)) return false;
    line[strcspn(line, "\n")] = '\0';
    return true;
}

#endif
