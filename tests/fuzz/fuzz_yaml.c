/* A scenario of any bytes is loaded or refused in one line with the name of the file. */
#include "fuzz.h"

#include "scenario/scenario.h"

#include <string.h>

/* Whole stacks, so that a leak is known by who made it. */
const char *__asan_default_options(void);
const char *__asan_default_options(void)
{
    return "fast_unwind_on_malloc=0";
}

/* libfyaml 0.7.12 loses a list of its own when it joins the lines of a scalar of very many lines. Once a scenario, at the start
 * of a program. */
const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:fy_atom_iter_chunk_next";
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct scenario s;
    char why[512] = "";
    const bool ok = scenario_parse("fuzz", (const char *)data, size, &s, why, sizeof why);
    assert(ok ? s.unit_count > 0 : strncmp(why, "fuzz:", 5) == 0 || strchr(why, '/'));
    assert(strlen(why) < sizeof why && !strchr(why, '\n'));
    return 0;
}
