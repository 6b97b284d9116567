/* What libFuzzer calls: any bytes; the run ends at the first crash, hang or sanitizer report. */
#ifndef PSABENCH_TESTS_FUZZ_H
#define PSABENCH_TESTS_FUZZ_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

#endif
