/* A bench with every instrument, and lines said to it in SCPI. */
#ifndef PSABENCH_TESTS_SCPI_SAY_H
#define PSABENCH_TESTS_SCPI_SAY_H

#include "page.h"
#include "rig.h"
#include "scpi_rig.h"

#include "base/text.h"
#include "scpi/lex.h"

#include <stdio.h>
#include <stdlib.h>

static struct scpi_rig rig;

static inline int head(void **state)
{
    (void)state;
    scpi_rig_init(&rig, "head");
    scpi_rig_say(&rig, &rig.scpi, "*CLS");
    return 0;
}

static inline int table(void **state)
{
    (void)state;
    scpi_rig_init(&rig, "table");
    scpi_rig_say(&rig, &rig.scpi, "*CLS");
    return 0;
}

static inline const char *say(const char *line)
{
    return scpi_rig_say(&rig, &rig.scpi, line);
}

#define SAYS(line, want) assert_string_equal(say(line), want)

/* The number of the oldest error, taken off the queue. */
static inline int error(void)
{
    return atoi(say("SYST:ERR?"));
}

#endif
