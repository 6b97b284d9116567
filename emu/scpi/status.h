/* What a SCPI instrument tells one client of itself: IEEE 488.2 clause 11 status, SCPI-99 20 registers, error queue. */
#ifndef PSABENCH_SCPI_STATUS_H
#define PSABENCH_SCPI_STATUS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define SCPI_ERRORS_MAX     16u
#define SCPI_ERROR_TEXT_MAX 256u /* SCPI-99 volume 2, 21.8.2: description and what is added to it, 255 characters */

enum {
    SCPI_ESR_OPC = 1,
    SCPI_ESR_QYE = 4, /* query */
    SCPI_ESR_DDE = 8, /* device dependent */
    SCPI_ESR_EXE = 16,
    SCPI_ESR_CME = 32, /* command */
    SCPI_ESR_PON = 128
};

enum {
    SCPI_STB_ERRORS = 4, /* error queue not empty */
    SCPI_STB_QUESTIONABLE = 8,
    SCPI_STB_MAV = 16,
    SCPI_STB_ESB = 32,
    SCPI_STB_MSS = 64,
    SCPI_STB_OPERATION = 128
};

/* OPERation and QUEStionable conditions that an instrument here can have; SCPI-99 volume 2, 20.1 and 20.2. */
enum { SCPI_OPER_SETTLING = 2, SCPI_OPER_SWEEPING = 8, SCPI_QUES_VOLTAGE = 1, SCPI_QUES_TEMPERATURE = 16 };

struct scpi_group {
    uint16_t condition, event, enable;
};

struct scpi_error {
    int code;
    char text[SCPI_ERROR_TEXT_MAX];
};

struct scpi_status {
    uint16_t esr, ese, sre; /* of 8 bits */
    struct scpi_group operation, questionable;
    struct scpi_error error[SCPI_ERRORS_MAX]; /* a ring */
    unsigned first, errors;
};

void scpi_status_init(struct scpi_status *s); /* as after power-on */

/* Queues an error: its standard text, then, after a semicolon, what is the matter (NULL: nothing). A full queue ends in -350. */
void scpi_error(struct scpi_status *s, int code, const char *what);

/* The oldest error, taken off the queue, as `-222,"Data out of range;..."`; `0,"No error"` when there is none. */
void scpi_error_next(struct scpi_status *s, char *out, size_t cap);

/* A new condition; its bits that rise become events. */
void scpi_condition(struct scpi_group *g, uint16_t condition);

/* The status byte with MSS; queued: a response waits to be read. */
uint8_t scpi_stb(const struct scpi_status *s, bool queued);

void scpi_cls(struct scpi_status *s);

/* "Data out of range", NULL for a number that is not the standard's. */
const char *scpi_error_text(int code);

#endif
