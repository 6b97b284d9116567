/* What the files of this folder share. Not for others. */
#ifndef PSABENCH_SCPI_INTERNAL_H
#define PSABENCH_SCPI_INTERNAL_H

#include "scpi/lex.h"
#include "scpi/scpi.h"

/* Why a unit was not carried out: a standard number, and what is the matter in words. */
struct scpi_failure {
    int code;
    char what[CONTROL_WHY_MAX];
};

/* One execution of it. */
struct scpi_call {
    struct scpi *s;
    const struct scpi_command *row;
    unsigned value; /* of the parameter */
    int64_t t_ns;
};

/* Adds an answer to the response under way. */
void scpi_put(struct scpi *s, const char *text);
__attribute__((format(printf, 2, 3))) void scpi_putf(struct scpi *s, const char *format, ...);

/* The fields of a result, named with commas between. */
void scpi_put_fields(struct scpi *s, const cJSON *result, const char *fields);

/* Whether a pattern is a query. */
bool scpi_asks(const char *pattern);

/* The instrument's row that has this pattern matched by header; suffix[4] filled in. NULL: none. */
const struct control_command *scpi_find_row(const struct scpi *s, struct scpi_text header, bool query,
                                            const struct control_scpi **how, unsigned suffix[4]);

/* Suffixes and parameters as the arguments of a row; NULL with the failure. The caller deletes it. */
cJSON *scpi_args(const struct control_bench *b, const struct control_command *row, const struct control_scpi *how,
                 const unsigned suffix[4], const struct scpi_unit *u, struct scpi_failure *why);

/* MINimum, MAXimum, DEFault of a row's argument. False: the word is none of these. */
bool scpi_limit(const struct control_bench *b, const struct control_command *row, unsigned arg,
                const unsigned suffix[4], struct scpi_text word, double *out);

/* Starts to wait for the end of what the instrument does. */
void scpi_await(struct scpi *s, int64_t t_ns);

#endif
