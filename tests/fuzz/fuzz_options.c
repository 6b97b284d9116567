/* A command line of any words: parsed into values within their ranges, or refused in one line. The input is the words, a NUL
 * between two. Durations are read alone, too. */
#include "fuzz.h"

#include "app/options.h"

#include <string.h>

enum { WORDS_MAX = 16, BYTES_MAX = 1024 };

static void check(const struct options *o)
{
    assert(o->can_count <= OPTIONS_CAN_MAX && o->action <= OPTIONS_DUMP);
    assert(o->pace == PACE_WALL || o->pace == PACE_STEP || o->pace == PACE_FREE);
    assert(o->for_ns >= 0 && o->vcd_unit_ns > 0 && o->line_hz > 0);
    assert(o->pace != PACE_STEP || o->control);
    assert(o->mavlink_count <= OPTIONS_MAVLINK_MAX);
    for (unsigned i = 0; i < o->mavlink_count; i++) {
        const struct mav_options *m = &o->mavlink[i];
        assert(m->kind <= MAV_PTY && m->sysid && m->compid && (m->kind != MAV_UDP_OUT || m->port));
        assert(m->imu_hz >= 0 && m->imu_hz <= 10000 && m->angles_hz >= 0 && m->hil_hz >= 0 && m->hil_hz <= 10000);
    }
    for (unsigned i = 0; i < o->can_count; i++) {
        assert(o->can[i].kind <= OPTIONS_CAN_LOG);
        assert(o->can[i].arg || (o->can[i].kind != OPTIONS_SOCKETCAN && o->can[i].kind != OPTIONS_CAN_LOG));
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static char text[BYTES_MAX + 1];
    char *argv[WORDS_MAX + 2] = {"psa-emu"};
    char why[300] = "";
    struct options o;
    const size_t n = size < BYTES_MAX ? size : BYTES_MAX;
    int argc = 1;
    if (n) memcpy(text, data, n);
    text[n] = '\0';
    for (size_t at = 0; at < n && argc <= WORDS_MAX; at += strlen(text + at) + 1) {
        int64_t ns = -1;
        assert(!options_duration(text + at, &ns) || (ns >= 0 && ns <= INT64_C(1000000000000000)));
        argv[argc++] = text + at;
    }
    if (options_parse(argc, argv, &o, why, sizeof why)) check(&o);
    else assert(why[0] && memchr(why, '\0', sizeof why) && !strchr(why, '\n'));
    return 0;
}
