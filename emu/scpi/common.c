/* Commands of every instrument: IEEE 488.2 clause 10, and what SCPI-99 volume 1, 4.2.1 asks of all. */
#include "base/text.h"
#include "scpi/internal.h"

#include <string.h>

#define VERSION TEXT_OF(PSABENCH_VERSION) /* from pyproject.toml by way of the Makefile */

/* ---- registers of struct scpi_status */

static uint16_t *status_reg(const struct scpi_call *call)
{
    return (uint16_t *)(void *)((char *)&call->s->status + call->row->offset);
}

static void ask_reg(const struct scpi_call *call)
{
    scpi_putf(call->s, "%u", *status_reg(call));
}

static void set_reg(const struct scpi_call *call)
{
    *status_reg(call) = (uint16_t)(call->value & ~call->row->zeros);
}

/* Event registers are cleared by reading. */
static void take_reg(const struct scpi_call *call)
{
    ask_reg(call);
    *status_reg(call) = 0;
}

/* ---- common commands */

static void put_answer(const struct scpi_call *call)
{
    scpi_put(call->s, call->row->answer);
}

static void do_cls(const struct scpi_call *call)
{
    scpi_cls(&call->s->status);
    call->s->opc = false;
}

static void do_idn(const struct scpi_call *call)
{
    scpi_putf(call->s, "psabench,%s,0,%s", call->s->kind->model, VERSION); /* 0: no serial number, 488.2 10.14.3 */
}

static void do_opc(const struct scpi_call *call)
{
    call->s->opc = true;
    scpi_await(call->s, call->t_ns);
}

static void do_opc_query(const struct scpi_call *call)
{
    call->s->wait = SCPI_OPC_QUERY;
    scpi_await(call->s, call->t_ns);
}

static void do_wai(const struct scpi_call *call)
{
    call->s->wait = SCPI_WAI;
    scpi_await(call->s, call->t_ns);
}

/* What the instrument has to do with it is in the command table: nothing for a head, which stays where it is. */
static void do_rst(const struct scpi_call *call)
{
    struct scpi *s = call->s;
    const struct control_scpi *how;
    const struct scpi_text header = {call->row->pattern, strlen(call->row->pattern)};
    unsigned suffix[4];
    s->opc = false;
    const struct control_command *reset = scpi_find_row(s, header, false, &how, suffix);
    if (!reset) return;
    cJSON *result = cJSON_CreateObject();
    if (control_call(s->control, reset->name, NULL, result, call->t_ns) == CONTROL_REJECTED) {
        scpi_error(&s->status, -200, s->control->error.why);
    }
    cJSON_Delete(result);
}

static void do_stb(const struct scpi_call *call)
{
    scpi_putf(call->s, "%u", scpi_stb(&call->s->status, call->s->out_len > 0));
}

/* ---- SYSTem, STATus */

static void do_error(const struct scpi_call *call)
{
    char text[SCPI_ERROR_TEXT_MAX + 16];
    scpi_error_next(&call->s->status, text, sizeof text);
    scpi_put(call->s, text);
}

static void do_error_all(const struct scpi_call *call)
{
    char all[SCPI_ERRORS_MAX * (SCPI_ERROR_TEXT_MAX + 16)];
    size_t at = 0;
    do {
        if (at) all[at++] = ',';
        scpi_error_next(&call->s->status, all + at, sizeof all - at);
        at += strlen(all + at);
    } while (call->s->status.errors);
    scpi_put(call->s, all);
}

static void do_error_count(const struct scpi_call *call)
{
    scpi_putf(call->s, "%u", call->s->status.errors);
}

static void do_preset(const struct scpi_call *call)
{
    call->s->status.operation.enable = call->s->status.questionable.enable = 0;
}

#define REG(field) offsetof(struct scpi_status, field)

enum { BIT_15 = 0x8000 }; /* of the registers of SCPI-99: always 0, volume 1, 9.1 */

// clang-format off
static const struct scpi_command rows[] = {
    {"*CLS", "Clear status: event registers and error queue.", .run = do_cls},
    {"*ESE", "Event status enable register.", .run = set_reg, .max = 255, .offset = REG(ese)},
    {"*ESE?", "Event status enable register.", .run = ask_reg, .offset = REG(ese)},
    {"*ESR?", "Event status register; cleared by reading.", .run = take_reg, .offset = REG(esr)},
    {"*IDN?", "Identification: manufacturer, model, serial number 0, version.", .run = do_idn},
    {"*OPC", "Operation complete: sets bit 0 of the event status register at the end of the motion.", .run = do_opc},
    {"*OPC?", "Operation complete query: returns 1 at the end of the motion.", .run = do_opc_query},
    {"*RST", "Resets the instrument to its power-on settings.", .run = do_rst},
    {"*SRE", "Service request enable register.", .run = set_reg, .max = 255, .offset = REG(sre), .zeros = SCPI_STB_MSS}, /* not to be enabled: 488.2 11.3.2.3 */
    {"*SRE?", "Service request enable register.", .run = ask_reg, .offset = REG(sre)},
    {"*STB?", "Status byte.", .run = do_stb},
    {"*TST?", "Self-test: 0, passed.", put_answer, .answer = "0"},
    {"*WAI", "Wait: the rest of the message waits for the end of the motion.", .run = do_wai},
    {"SYSTem:ERRor[:NEXT]?", "Oldest entry of this client's error queue; removed by reading.", .run = do_error},
    {"SYSTem:ERRor:ALL?", "All entries of the error queue; removed by reading.", .run = do_error_all},
    {"SYSTem:ERRor:COUNt?", "Number of entries in the error queue.", .run = do_error_count},
    {"SYSTem:VERSion?", "SCPI version.", put_answer, .answer = "1999.0"},
    {"STATus:OPERation[:EVENt]?", "Operation event register (bit 1 settling, bit 3 sweeping); cleared by reading.", .run = take_reg, .offset = REG(operation.event)},
    {"STATus:OPERation:CONDition?", "Operation condition register.", .run = ask_reg, .offset = REG(operation.condition)},
    {"STATus:OPERation:ENABle", "Operation enable register: event bits summed in bit 7 of the status byte.", .run = set_reg, .max = 65535, .zeros = BIT_15, .offset = REG(operation.enable)},
    {"STATus:OPERation:ENABle?", "Operation enable register.", .run = ask_reg, .offset = REG(operation.enable)},
    {"STATus:QUEStionable[:EVENt]?", "Questionable event register (bit 0 voltage, bit 4 temperature); cleared by reading.", .run = take_reg, .offset = REG(questionable.event)},
    {"STATus:QUEStionable:CONDition?", "Questionable condition register.", .run = ask_reg, .offset = REG(questionable.condition)},
    {"STATus:QUEStionable:ENABle", "Questionable enable register: event bits summed in bit 3 of the status byte.", .run = set_reg, .max = 65535, .zeros = BIT_15, .offset = REG(questionable.enable)},
    {"STATus:QUEStionable:ENABle?", "Questionable enable register.", .run = ask_reg, .offset = REG(questionable.enable)},
    {"STATus:PRESet", "Clears the operation and questionable enable registers.", .run = do_preset},
};
// clang-format on

const struct scpi_command *scpi_common(unsigned i)
{
    return i < sizeof rows / sizeof *rows ? &rows[i] : NULL;
}
