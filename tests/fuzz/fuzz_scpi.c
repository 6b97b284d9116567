/* SCPI messages of any bytes, several a run, to two clients of each instrument, with time moving in between: a message is
 * answered by at most one line of printable characters, and the error queue only tells standard numbers. */
#include "fuzz.h"

#include "scpi_rig.h"

#include <stdlib.h>

static struct scpi_rig rig;
static struct scpi client[8];

static void check_answer(void)
{
    for (const char *c = rig.said; *c; c++) assert(*c >= ' ');
}

static void drain_errors(struct scpi *s)
{
    for (unsigned i = 0; i <= SCPI_ERRORS_MAX; i++) {
        const int code = atoi(scpi_rig_say(&rig, s, "SYST:ERR?"));
        assert(scpi_error_text(code) && code <= 0 && code > -500);
        if (code == 0) return;
    }
    abort(); /* a queue has an end */
}

static void init(void)
{
    scpi_rig_init(&rig, "head");
    for (unsigned i = 0; i < 8; i++) scpi_rig_session(&rig, &client[i], scpi_kinds[i % 4].name);
}

/* What waits without end, for a ramp of a century, still has its queue. */
static void finish(struct scpi *s)
{
    scpi_close(s);
    if (scpi_busy(s)) s->wait = SCPI_GO;
    drain_errors(s);
}

/* A line: client and time in its first byte, then the message. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    init();
    while (size > 0) {
        struct scpi *s = &client[*data & 7];
        sched_run_until(&rig.sched, rig.sched.now_ns + (*data >> 3) * INT64_C(10000000));
        const uint8_t *end = memchr(data, '\n', size);
        const size_t n = end ? (size_t)(end - data) : size;
        rig.said[0] = '\0';
        if (!scpi_busy(s)) scpi_line(s, (const char *)data + 1, n - 1 < SCPI_LINE_MAX ? n - 1 : 0, rig.sched.now_ns);
        check_answer();
        const size_t used = end ? n + 1 : n;
        data += used;
        size -= used;
    }
    sched_run_until(&rig.sched, rig.sched.now_ns + INT64_C(8640000000000));
    for (unsigned i = 0; i < 8; i++) finish(&client[i]);
    return 0;
}
