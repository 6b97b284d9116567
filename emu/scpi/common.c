/* Commands of every instrument: IEEE 488.2 clause 10, and what SCPI-99 volume 1, 4.2.1 asks of all. */
#include "base/text.h"
#include "scpi/internal.h"

#include <stdio.h>
#include <string.h>

#define VERSION TEXT_OF(PSABENCH_VERSION) /* from pyproject.toml by way of the Makefile */

/* ---- registers of struct scpi_status */

static void *status_reg(struct scpi *s, const struct scpi_command *row)
{
    return (char *)&s->status + row->offset;
}

static void ask_u8(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)value;
    (void)t_ns;
    scpi_putf(s, "%u", *(const uint8_t *)status_reg(s, row));
}

static void set_u8(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)t_ns;
    *(uint8_t *)status_reg(s, row) = (uint8_t)value;
}

static void set_sre(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    set_u8(s, row, value & ~(unsigned)SCPI_STB_MSS, t_ns); /* bit 6 is not to be enabled: 488.2 11.3.2.3 */
}

static void ask_u16(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    uint16_t v;
    (void)value;
    (void)t_ns;
    memcpy(&v, status_reg(s, row), sizeof v);
    scpi_putf(s, "%u", v);
}

static void set_u16(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    const uint16_t v = (uint16_t)(value & 0x7FFF); /* bit 15 is always 0: SCPI-99 volume 1, 9.1 */
    (void)t_ns;
    memcpy(status_reg(s, row), &v, sizeof v);
}

/* Event registers are cleared by reading. */
static void take_u8(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    ask_u8(s, row, value, t_ns);
    set_u8(s, row, 0, t_ns);
}

static void take_u16(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    ask_u16(s, row, value, t_ns);
    set_u16(s, row, 0, t_ns);
}

/* ---- common commands */

static void do_cls(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    (void)t_ns;
    scpi_cls(&s->status);
    s->opc = false;
}

static void do_idn(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    (void)t_ns;
    scpi_putf(s, "psabench,%s,0,%s", s->kind->model, VERSION); /* 0: no serial number, 488.2 10.14.3 */
}

static void do_opc(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    s->opc = true;
    scpi_await(s, t_ns);
}

static void do_opc_query(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    s->wait = SCPI_OPC_QUERY;
    scpi_await(s, t_ns);
}

static void do_wai(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    s->wait = SCPI_WAI;
    scpi_await(s, t_ns);
}

/* What the instrument has to do with it is in the command table: nothing for a head, which stays where it is. */
static void do_rst(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    const struct control_scpi *how;
    unsigned suffix[4];
    (void)value;
    s->opc = false;
    const struct control_command *reset =
        scpi_find_row(s, (struct scpi_text){row->pattern, strlen(row->pattern)}, false, &how, suffix);
    if (!reset) return;
    cJSON *result = cJSON_CreateObject();
    if (control_call(s->control, reset->name, NULL, result, t_ns) == CONTROL_REJECTED) {
        scpi_error(&s->status, -200, s->control->error.why);
    }
    cJSON_Delete(result);
}

static void do_stb(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    (void)t_ns;
    scpi_putf(s, "%u", scpi_stb(&s->status, s->out_len > 0));
}

static void do_tst(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    (void)t_ns;
    scpi_put(s, "0");
}

/* ---- SYSTem, STATus */

static void do_error(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    char text[SCPI_ERROR_TEXT_MAX + 16];
    (void)row;
    (void)value;
    (void)t_ns;
    scpi_error_next(&s->status, text, sizeof text);
    scpi_put(s, text);
}

static void do_error_all(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    char all[SCPI_ERRORS_MAX * (SCPI_ERROR_TEXT_MAX + 16)];
    size_t at = 0;
    (void)row;
    (void)value;
    (void)t_ns;
    do {
        if (at) all[at++] = ',';
        scpi_error_next(&s->status, all + at, sizeof all - at);
        at += strlen(all + at);
    } while (s->status.errors);
    scpi_put(s, all);
}

static void do_error_count(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    (void)t_ns;
    scpi_putf(s, "%u", s->status.errors);
}

static void do_version(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    (void)t_ns;
    scpi_put(s, "1999.0");
}

static void do_preset(struct scpi *s, const struct scpi_command *row, unsigned value, int64_t t_ns)
{
    (void)row;
    (void)value;
    (void)t_ns;
    s->status.operation.enable = s->status.questionable.enable = 0;
}

#define REG(field) offsetof(struct scpi_status, field)

// clang-format off
static const struct scpi_command rows[] = {
    {"*CLS", "Clear status: event registers and error queue.", do_cls, 0, 0},
    {"*ESE", "Event status enable register.", set_u8, 255, REG(ese)},
    {"*ESE?", "Event status enable register.", ask_u8, 0, REG(ese)},
    {"*ESR?", "Event status register; cleared by reading.", take_u8, 0, REG(esr)},
    {"*IDN?", "Identification: manufacturer, model, serial number 0, version.", do_idn, 0, 0},
    {"*OPC", "Operation complete: sets bit 0 of the event status register at the end of the motion.", do_opc, 0, 0},
    {"*OPC?", "Operation complete query: returns 1 at the end of the motion.", do_opc_query, 0, 0},
    {"*RST", "Resets the instrument to its power-on settings.", do_rst, 0, 0},
    {"*SRE", "Service request enable register.", set_sre, 255, REG(sre)},
    {"*SRE?", "Service request enable register.", ask_u8, 0, REG(sre)},
    {"*STB?", "Status byte.", do_stb, 0, 0},
    {"*TST?", "Self-test: 0, passed.", do_tst, 0, 0},
    {"*WAI", "Wait: the rest of the message waits for the end of the motion.", do_wai, 0, 0},
    {"SYSTem:ERRor[:NEXT]?", "Oldest entry of this client's error queue; removed by reading.", do_error, 0, 0},
    {"SYSTem:ERRor:ALL?", "All entries of the error queue; removed by reading.", do_error_all, 0, 0},
    {"SYSTem:ERRor:COUNt?", "Number of entries in the error queue.", do_error_count, 0, 0},
    {"SYSTem:VERSion?", "SCPI version.", do_version, 0, 0},
    {"STATus:OPERation[:EVENt]?", "Operation event register (bit 1 settling, bit 3 sweeping); cleared by reading.", take_u16, 0, REG(operation.event)},
    {"STATus:OPERation:CONDition?", "Operation condition register.", ask_u16, 0, REG(operation.condition)},
    {"STATus:OPERation:ENABle", "Operation enable register: event bits summed in bit 7 of the status byte.", set_u16, 65535, REG(operation.enable)},
    {"STATus:OPERation:ENABle?", "Operation enable register.", ask_u16, 0, REG(operation.enable)},
    {"STATus:QUEStionable[:EVENt]?", "Questionable event register (bit 0 voltage, bit 4 temperature); cleared by reading.", take_u16, 0, REG(questionable.event)},
    {"STATus:QUEStionable:CONDition?", "Questionable condition register.", ask_u16, 0, REG(questionable.condition)},
    {"STATus:QUEStionable:ENABle", "Questionable enable register: event bits summed in bit 3 of the status byte.", set_u16, 65535, REG(questionable.enable)},
    {"STATus:QUEStionable:ENABle?", "Questionable enable register.", ask_u16, 0, REG(questionable.enable)},
    {"STATus:PRESet", "Clears the operation and questionable enable registers.", do_preset, 0, 0},
};
// clang-format on

const struct scpi_command *scpi_common(unsigned i)
{
    return i < sizeof rows / sizeof *rows ? &rows[i] : NULL;
}
