/* A scenario of any bytes is loaded or refused in one line with the name of the file. */
#include "fuzz.h"

#include "app/scenario_yaml.h"

#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static struct scenario s;
    char why[512] = "";
    const bool ok = scenario_parse("fuzz", (const char *)data, size, &s, why, sizeof why);
    assert(ok ? s.unit_count > 0 : strncmp(why, "fuzz:", 5) == 0 || strchr(why, '/'));
    assert(strlen(why) < sizeof why && !strchr(why, '\n'));
    return 0;
}
