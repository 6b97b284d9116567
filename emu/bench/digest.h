/* One number for the state of a bench: two benches that will behave alike have the same one, others hardly. */
#ifndef PSABENCH_BENCH_DIGEST_H
#define PSABENCH_BENCH_DIGEST_H

#include "base/sha256.h"
#include "bench/journal.h"

/* Over time, buses with all that went over them, and of each unit what board, converters, sensors and CAN node hold. It does
 * not depend on who watches or on the steps in which time moved. */
void digest_bench(const struct bench *b, const struct journal *j, char hex[SHA256_HEX]);

#endif
