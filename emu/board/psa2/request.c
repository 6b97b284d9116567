#include "board/psa2/internal.h"

#include <assert.h>
#include <stddef.h>

#define T6_TAU        50  /* command to data, sources 2.4 */
#define CONFIG1_WORDS 63u /* words that mix two settings of CONFIG1 (sources 1.6, M55) */

/* ---- what the converters take ---- */

static const struct reg_file *file_of(const struct psa2 *b, enum psa2_group group)
{
    return group == PSA2_ACCEL ? &b->adc[0].regs : &b->tadc.regs;
}

/* Codes a part reserves, and modes that KPSA cannot read. */
static bool accel_takes(const struct psa2 *b, uint8_t addr, uint8_t value)
{
    if (addr == ADS1282_CONFIG0) return ads1282_models(value);
    if (addr == ADS1282_CONFIG1 && !b->profile.adc_is_1281) return (value & 7) != 7 && (value >> 4 & 7) <= 4;
    return true;
}

static bool temp_takes(uint8_t addr, uint8_t value)
{
    return addr != ADS1256_DRATE || ads1256_rate_of(value);
}

static enum psa2_result check_register(const struct psa2 *b, const struct psa2_request *r)
{
    const struct reg_file *f = file_of(b, r->group);
    if (r->addr >= f->count || !f->map[r->addr].name) return PSA2_NO_SUCH_REG;
    if (r->op == PSA2_READ_REG) return PSA2_OK;
    if (f->map[r->addr].rw == 0) return PSA2_READ_ONLY;
    if (r->value & f->map[r->addr].unimp) return PSA2_BAD_VALUE;
    const bool takes = r->group == PSA2_ACCEL ? accel_takes(b, r->addr, r->value) : temp_takes(r->addr, r->value);
    return takes ? PSA2_OK : PSA2_BAD_VALUE;
}

/* Whole commands of one byte that the models carry out and that leave KPSA able to read on: no RREG or WREG without its
 * other bytes, no RDATA whose answer no one would take. */
static bool is_opcode(enum psa2_group group, uint8_t op)
{
    static const uint8_t accel[] = {0x00, 0x01, 0x04, 0x05, 0x06, 0x07, 0x10, 0x11};
    static const uint8_t temp[] = {0x00, 0x0F, 0xF0, 0xF1, 0xF2, 0xFC, 0xFE, 0xFF};
    const uint8_t *list = group == PSA2_ACCEL ? accel : temp;
    const size_t count = group == PSA2_ACCEL ? sizeof accel : sizeof temp;
    for (size_t i = 0; i < count; i++)
        if (list[i] == op) return true;
    return false;
}

static enum psa2_result check_request(const struct psa2 *b, const struct psa2_request *r)
{
    switch (r->op) {
    case PSA2_READ_REG:
    case PSA2_WRITE_REG:
        return check_register(b, r);
    case PSA2_OPCODE:
        return is_opcode(r->group, r->value) ? PSA2_OK : PSA2_BAD_VALUE;
    case PSA2_PULSE_SYNC:
        return PSA2_OK;
    }
    return PSA2_BAD_VALUE;
}

enum psa2_result psa2_request_accept(struct psa2 *b, struct psa2_request *r)
{
    const enum psa2_result result = check_request(b, r);
    if (result != PSA2_OK) return result;
    if (b->mode != PSA2_RUN || b->request) return PSA2_BUSY;
    assert(r->done);
    b->request = r;
    b->counters.requests++;
    return PSA2_OK;
}

/* ---- carrying out ---- */

static bool touches_registers(const struct psa2_request *r)
{
    return r->op == PSA2_READ_REG || r->op == PSA2_WRITE_REG;
}

static void finish_request(struct psa2 *b, enum psa2_result result, int64_t t_ns)
{
    struct psa2_request *r = b->request;
    b->request = NULL;
    r->done(r->ctx, r, result, t_ns);
}

void psa2_request_fail(struct psa2 *b, enum psa2_group group, bool all, int64_t t_ns)
{
    if (!b->request) return;
    if (all || (b->request->group == group && touches_registers(b->request))) finish_request(b, PSA2_TIMEOUT, t_ns);
}

static void take_answer(struct psa2 *b, struct psa2_request *r)
{
    if (r->op != PSA2_READ_REG) return;
    for (unsigned i = 0; i < 3; i++) r->answer[i] = r->group == PSA2_ACCEL ? b->spi.rx[i][3] : 0;
    if (r->group == PSA2_TEMP) r->answer[0] = b->spi.rx[3][2];
}

/* A converter that restarts gives settled words only; a write to CONFIG1 does not restart it. */
static unsigned unsettled_after(const struct psa2 *b, const struct psa2_request *r)
{
    const bool write = r->op == PSA2_WRITE_REG;
    if (write && r->addr == ADS1282_CONFIG1 && !b->profile.adc_is_1281) return CONFIG1_WORDS;
    const bool restarts = (write && r->addr == ADS1282_CONFIG0) ||
                          (r->op == PSA2_OPCODE && r->value >= 0x04 && r->value <= 0x07); /* SYNC, RESET */
    return restarts ? 0 : b->sample.unsettled;
}

static void record_change(struct psa2 *b, const struct psa2_request *r, int64_t t_ns)
{
    if (r->op == PSA2_READ_REG) return;
    if (r->group == PSA2_TEMP) {
        psa2_temp_disturbed(b, t_ns);
        return;
    }
    b->sample.unsettled = unsettled_after(b, r);
    psa2_arm_timeout(b, t_ns);
}

static void carried_out(struct psa2 *b, int64_t t_ns)
{
    assert(b->request); /* a reset ends the burst with the request; the timeout expires only between bursts */
    take_answer(b, b->request);
    record_change(b, b->request, t_ns);
    finish_request(b, PSA2_OK, t_ns);
}

/* SDATAC before RREG and RDATAC after it: sources 1.3, footnote 4 of the command table. WREG needs neither. */
static struct psa2_xfer accel_xfer(const struct psa2 *b, const struct psa2_request *r)
{
    const uint8_t read[] = {0x11, (uint8_t)(0x20 | r->addr), 0x00, 0x00, 0x10};
    const uint8_t write[] = {(uint8_t)(0x40 | r->addr), 0x00, r->value};
    if (r->op == PSA2_READ_REG) return psa2_xfer_accel(b, read, sizeof read);
    if (r->op == PSA2_WRITE_REG) return psa2_xfer_accel(b, write, sizeof write);
    return psa2_xfer_accel(b, &r->value, 1);
}

static struct psa2_xfer temp_xfer(const struct psa2 *b, const struct psa2_request *r)
{
    const uint8_t read[] = {(uint8_t)(0x10 | r->addr), 0x00, 0x00};
    const uint8_t write[] = {(uint8_t)(0x50 | r->addr), 0x00, r->value};
    if (r->op == PSA2_WRITE_REG) return psa2_xfer_temp(b, write, sizeof write);
    if (r->op == PSA2_OPCODE) return psa2_xfer_temp(b, &r->value, 1);
    struct psa2_xfer x = psa2_xfer_temp(b, read, sizeof read);
    x.gap_ns[1] = psa2_tau_ns(b, T6_TAU);
    return x;
}

static bool may_start(const struct psa2 *b, const struct psa2_request *r, int64_t span_ns, int64_t t_ns)
{
    if (touches_registers(r) && r->group == PSA2_ACCEL && !psa2_flowing(b, t_ns)) return false;
    if (touches_registers(r) && r->group == PSA2_TEMP && !psa2_temp_free(b)) return false;
    return psa2_window(b, span_ns, t_ns);
}

bool psa2_request_start(struct psa2 *b, int64_t t_ns)
{
    const struct psa2_request *r = b->request;
    if (r->op == PSA2_PULSE_SYNC) {
        psa2_pulse(b, r->group, carried_out, t_ns);
        return true;
    }
    struct psa2_xfer x = r->group == PSA2_ACCEL ? accel_xfer(b, r) : temp_xfer(b, r);
    x.done = carried_out;
    if (!may_start(b, r, psa2_spi_span_ns(b, &b->spi.past, &x, t_ns), t_ns)) return false;
    psa2_spi_start(b, &x, t_ns);
    return true;
}
