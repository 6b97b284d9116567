/* Text of the bus port: cycles of a board's parallel bus as a register-level bridge gives them, one line each. Pure.
 *
 * To the board (LF ends a line, a CR before it is ignored; fields are separated by blanks; letters in any case):
 *
 *     R <address> [<strobe ns>]           read cycle; address: 1 or 2 hex digits, with or without an h
 *     W <address> <data> [<strobe ns>]    write cycle; data: 1 to 4 hex digits
 *     ?                                   identification
 *
 * The strobe is decimal, 1 to 999999999; without it, it has the board's own length. To the host, one line for each of its
 * lines, in their order (t: simulated ns at the end of the strobe, or of the rejection;
 * an address: two hex digits and h):
 *
 *     R <address> <data> t=<ns>           data: 4 hex digits
 *     W <address> <data> t=<ns>           written
 *     I <board> <address>=<name> ... t=<ns>
 *     E <code> <R|W|?|-> <address|-> t=<ns>
 *
 * Codes of the board: no-address read-only write-only not-ready taken too-short busy bad-value off. Of the port: syntax (no such
 * letter, a field too few or too many), number (a field is no number or too large), overlong (more than 80 characters). */
#ifndef PSABENCH_LINK_LINE_BUS_TEXT_H
#define PSABENCH_LINK_LINE_BUS_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BUS_TEXT_LINE_MAX 80u  /* characters of a line to the board */
#define BUS_TEXT_MAX      320u /* of an answer with its LF and NUL */

enum bus_op { BUS_READ, BUS_WRITE, BUS_WHO };

struct bus_request {
    enum bus_op op;
    uint8_t address;
    uint16_t data;     /* write */
    int64_t strobe_ns; /* 0: the board's own */
};

enum bus_text_err { BUS_TEXT_OK, BUS_TEXT_SYNTAX, BUS_TEXT_NUMBER, BUS_TEXT_OVERLONG };

/* line need not end in NUL. On an error *out has the fields decoded before it: its op and address may be answered. */
enum bus_text_err bus_text_parse(const char *line, size_t len, struct bus_request *out, unsigned *fields);

/* The code word of an error; "" for BUS_TEXT_OK. */
const char *bus_text_code(enum bus_text_err err);

/* Answers, LF and NUL included, at most BUS_TEXT_MAX; characters without the NUL. fields: how many of the request were
 * understood (1: the letter, 2: the address, too). */
size_t bus_text_done(const struct bus_request *r, uint16_t data, int64_t t_ns, char *out);
size_t bus_text_refused(const struct bus_request *r, unsigned fields, const char *code, int64_t t_ns, char *out);

#endif
