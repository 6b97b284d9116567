/* Faults of an instrument's SCPI link, as its port asks for them. */
#ifndef PSABENCH_FAULT_SCPI_H
#define PSABENCH_FAULT_SCPI_H

#include "fault/fault.h"

struct fault_scpi {
    bool silent;           /* nothing comes through, either way */
    int64_t late_ns;       /* of each answer */
    struct fault *garbles; /* NULL: none does */
};

/* What is active at the link of the instrument, "head". */
struct fault_scpi fault_scpi_of(struct fault_engine *e, const char *instrument);

/* An answer as a line of the wrong parity or speed hands it on: the top bit of one of its bytes is set. */
void fault_scpi_garble(const struct fault_scpi *f, char *text, size_t n);

#endif
