/* Words of a SCPI program message (IEEE 488.2 clause 7, SCPI-99 volume 1 chapters 5 to 7): pure, bounded, no state.
 *
 *   AXIS1:POSition 30 DEG, 5 DPS; RATE?        two units: header, parameters; header
 *
 * Text is reported by pointers into the message, which need not end in NUL and may have any bytes in it. */
#ifndef PSABENCH_SCPI_LEX_H
#define PSABENCH_SCPI_LEX_H

#include <stdbool.h>
#include <stddef.h>

#define SCPI_HEADER_MAX   80u /* characters, with the path before it */
#define SCPI_MNEMONIC_MAX 12u /* letters of a node, IEEE 488.2 7.6.1.4.1; its numeric suffix comes on top */
#define SCPI_WORD_MAX     31u /* of character data; 488.2 has 12, but side_reversed is longer */
#define SCPI_SUFFIX_MAX   12u
#define SCPI_PARAMS_MAX   72u

struct scpi_text {
    const char *p;
    size_t n;
};

enum scpi_form { SCPI_NUMBER, SCPI_WORD, SCPI_STRING };

struct scpi_param {
    enum scpi_form form;
    double number;
    struct scpi_text text; /* NUMBER: its suffix, perhaps empty; STRING: between the quotes, which are doubled inside */
};

struct scpi_unit {
    struct scpi_text header; /* without a leading colon and the question mark */
    bool rooted;             /* had a leading colon */
    bool common;             /* begins with * */
    bool query;
    struct scpi_param param[SCPI_PARAMS_MAX];
    unsigned params;
};

/* Takes the next unit off the message, with the semicolon after it. 0, or the standard's error number: then the rest of the
 * message is to be thrown away. header.n is 0 for an empty unit. */
int scpi_lex_unit(struct scpi_text *message, struct scpi_unit *u);

/* One mnemonic of a pattern, its short form in capitals, against text, in any case: POSition is POS or POSITION. */
bool scpi_is(const char *mnemonic, size_t len, struct scpi_text text);

/* A header with its path against a pattern: # takes a numeric suffix (1 if there is none), [:NODe] may be left out. The
 * pattern may end in ?, which is not looked at. The suffixes found go to suffix[4]. */
bool scpi_match(const char *pattern, struct scpi_text header, unsigned suffix[4]);

/* A number with a suffix in the unit of an argument, say "deg": 0, or the error number -131 or -138. unit NULL: none. */
int scpi_to_unit(const char *unit, struct scpi_text suffix, double number, double *out);

/* The i-th suffix that goes with a unit: "DEG"; NULL past the last. */
const char *scpi_suffix(const char *unit, unsigned i);

#endif
