#include "api/internal.h"

#include "base/text.h"
#include "base/why.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifndef PSABENCH_VERSION
#error "the Makefile takes PSABENCH_VERSION from pyproject.toml"
#endif

int psabench_abi(void)
{
    return PSABENCH_ABI;
}

const char *psabench_version(void)
{
    return TEXT_OF(PSABENCH_VERSION);
}

int api_fail(psabench *b, int code, const char *format, ...)
{
    if (!b) return code;
    va_list args;
    va_start(args, format);
    (void)vsnprintf(b->error, sizeof b->error, format, args);
    va_end(args);
    text_one_line(b->error);
    return code;
}

psabench *psabench_new(uint64_t seed)
{
    psabench *b = calloc(1, sizeof *b);
    if (!b) return NULL;
    sched_init(&b->sched);
    b->seed = seed;
    b->deadline.t_ns = INT64_MAX;
    return b;
}

void psabench_free(psabench *b)
{
    if (!b || b->inside || b->serving) return;
    b->inside++; /* the last edges may still reach watchers */
    (void)api_vcd_end(b);
    while (b->parts) {
        struct psabench_part *p = b->parts;
        b->parts = p->next;
        free(p->queue.edge);
        free(p);
    }
    free(b);
}

const char *psabench_error_text(const psabench *b)
{
    return b ? b->error : "no bench: the pointer is NULL";
}

int api_may_move(psabench *b, const char *function)
{
    if (!b->inside) return PSABENCH_OK;
    return api_fail(b, PSABENCH_BAD_ARGUMENT, "%s: expected a call outside callbacks, where time may advance",
                    function);
}

/* ---- recording ---- */

int psabench_vcd_close(psabench *b)
{
    if (!b) return PSABENCH_BAD_ARGUMENT;
    const int may = api_may_move(b, "psabench_vcd_close()");
    if (may) return may;
    b->inside++;
    const int error = api_vcd_end(b);
    b->inside--;
    return error ? api_fail(b, PSABENCH_SYSTEM, "recording: incomplete: %s", strerror(error)) : PSABENCH_OK;
}

int psabench_vcd(psabench *b, const char *path)
{
    const int closed = psabench_vcd_close(b);
    if (closed) return closed;
    if (!path) return api_fail(b, PSABENCH_BAD_ARGUMENT, "psabench_vcd(): expected a path, got NULL");
    const int error = api_vcd_begin(b, path);
    char why[320], where[208];
    if (!error) return PSABENCH_OK;
    snprintf(where, sizeof where, "%.200s", path);
    why_unwritable(why, sizeof why, where, error);
    return api_fail(b, PSABENCH_SYSTEM, "%s", why);
}
