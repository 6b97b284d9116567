/* What libFuzzer calls: any bytes; the run ends at the first crash, hang or sanitizer report. docs/fuzzing.md is the manual.
 *
 * Most targets read their input as a script: operations and their arguments, byte by byte, zeros behind the end. */
#ifndef PSABENCH_TESTS_FUZZ_H
#define PSABENCH_TESTS_FUZZ_H

#include <assert.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct script {
    const uint8_t *at, *end;
};

static inline struct script script_of(const uint8_t *data, size_t size)
{
    return (struct script){data, size ? data + size : data};
}

static inline bool script_more(const struct script *s)
{
    return s->at != s->end;
}

static inline uint8_t script_byte(struct script *s)
{
    return script_more(s) ? *s->at++ : 0;
}

/* n bytes, least significant first; n up to 8. */
static inline uint64_t script_uint(struct script *s, unsigned n)
{
    uint64_t v = 0;
    for (unsigned i = 0; i < n; i++) v |= (uint64_t)script_byte(s) << (8 * i);
    return v;
}

/* A span of time from one byte: 0 .. 7 ns in steps of 1, then eight steps an octave up to 16 ms. */
static inline int64_t script_span_ns(struct script *s)
{
    const uint8_t b = script_byte(s);
    const unsigned octave = (b >> 3) % 22;
    const int64_t step = b & 7;
    return octave ? (8 + step) << (octave - 1) : step;
}

#endif
