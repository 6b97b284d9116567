#include "scpi/status.h"

#include <stdio.h>
#include <string.h>

/* SCPI-99 volume 2, 21.8. */
static const struct {
    int code;
    const char *text;
} texts[] = {
    {0, "No error"},
    {-100, "Command error"},
    {-101, "Invalid character"},
    {-102, "Syntax error"},
    {-103, "Invalid separator"},
    {-104, "Data type error"},
    {-108, "Parameter not allowed"},
    {-109, "Missing parameter"},
    {-111, "Header separator error"},
    {-112, "Program mnemonic too long"},
    {-113, "Undefined header"},
    {-114, "Header suffix out of range"},
    {-121, "Invalid character in number"},
    {-123, "Exponent too large"},
    {-124, "Too many digits"},
    {-128, "Numeric data not allowed"},
    {-131, "Invalid suffix"},
    {-134, "Suffix too long"},
    {-138, "Suffix not allowed"},
    {-144, "Character data too long"},
    {-148, "Character data not allowed"},
    {-151, "Invalid string data"},
    {-158, "String data not allowed"},
    {-168, "Block data not allowed"},
    {-178, "Expression data not allowed"},
    {-200, "Execution error"},
    {-220, "Parameter error"},
    {-221, "Settings conflict"},
    {-222, "Data out of range"},
    {-223, "Too much data"},
    {-224, "Illegal parameter value"},
    {-240, "Hardware error"},
    {-241, "Hardware missing"},
    {-350, "Queue overflow"},
    {-363, "Input buffer overrun"},
    {-430, "Query DEADLOCKED"},
};

const char *scpi_error_text(int code)
{
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        if (texts[i].code == code) return texts[i].text;
    }
    return NULL;
}

void scpi_status_init(struct scpi_status *s)
{
    *s = (struct scpi_status){.esr = SCPI_ESR_PON};
}

/* Which bit of the event status register a class of errors sets: SCPI-99 volume 2, 21.8.9 to 21.8.12. */
static uint8_t class_bit(int code)
{
    static const uint8_t bit[] = {0, SCPI_ESR_CME, SCPI_ESR_EXE, SCPI_ESR_DDE, SCPI_ESR_QYE};
    const int class = -code / 100;
    return class >= 1 && class <= 4 ? bit[class] : 0;
}

/* The description is a string of an answer: 7-bit ASCII in double quotes, IEEE 488.2-1992, 8.7.8. It may cite a client's bytes. */
static void clean_text(char *text)
{
    for (; *text; text++) {
        if (*text == '"') *text = '\'';
        if (*text < ' ' || *text > '~') *text = '?';
    }
}

void scpi_error(struct scpi_status *s, int code, const char *what)
{
    s->esr |= class_bit(code);
    const bool full = s->errors == SCPI_ERRORS_MAX;
    if (full) code = -350; /* in place of the last */
    struct scpi_error *e = &s->error[(s->first + s->errors - full) % SCPI_ERRORS_MAX];
    s->errors += !full;
    e->code = code;
    if (what && !full) snprintf(e->text, sizeof e->text, "%s;%s", scpi_error_text(code), what);
    else snprintf(e->text, sizeof e->text, "%s", scpi_error_text(code));
    clean_text(e->text);
}

void scpi_error_next(struct scpi_status *s, char *out, size_t cap)
{
    static const struct scpi_error none = {0, "No error"};
    const struct scpi_error *e = s->errors ? &s->error[s->first] : &none;
    snprintf(out, cap, "%d,\"%s\"", e->code, e->text);
    if (!s->errors) return;
    s->first = (s->first + 1) % SCPI_ERRORS_MAX;
    s->errors--;
}

void scpi_condition(struct scpi_group *g, uint16_t condition)
{
    g->event |= (uint16_t)(condition & ~g->condition);
    g->condition = condition;
}

uint8_t scpi_stb(const struct scpi_status *s, bool queued)
{
    unsigned stb = 0;
    if (s->errors) stb |= SCPI_STB_ERRORS;
    if (s->questionable.event & s->questionable.enable) stb |= SCPI_STB_QUESTIONABLE;
    if (queued) stb |= SCPI_STB_MAV;
    if (s->esr & s->ese) stb |= SCPI_STB_ESB;
    if (s->operation.event & s->operation.enable) stb |= SCPI_STB_OPERATION;
    if (stb & s->sre) stb |= SCPI_STB_MSS;
    return (uint8_t)stb;
}

void scpi_cls(struct scpi_status *s)
{
    s->esr = 0;
    s->operation.event = s->questionable.event = 0;
    s->first = s->errors = 0;
}
