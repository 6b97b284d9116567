#include "canopen/co_sdo.h"

#include "base/bits.h"

#include <string.h>

/* Command specifiers, bits 7..5 of the first byte (CiA 301, 7.2.4.3). */
enum { CCS_DOWNLOAD_SEGMENT = 0, CCS_DOWNLOAD = 1, CCS_UPLOAD = 2, CCS_UPLOAD_SEGMENT = 3, CS_ABORT = 4 };
enum {
    SCS_DOWNLOAD_SEGMENT = 0x20,
    SCS_UPLOAD_SEGMENT = 0x00,
    SCS_UPLOAD = 0x40,
    SCS_DOWNLOAD = 0x60,
    SCS_ABORT = 0x80
};
enum { BIT_SIZE = 0x01, BIT_EXPEDITED = 0x02, BIT_TOGGLE = 0x10, BIT_LAST = 0x01 };
enum { EXPEDITED_MAX = 4, SEGMENT_MAX = 7 };

static void finish_transfer(struct co_sdo *s)
{
    s->state = CO_SDO_IDLE;
    s->ticket++;
    sched_cancel(s->sched, &s->timeout);
}

static void send_abort(struct co_sdo *s, uint32_t code, int64_t t_ns)
{
    uint8_t frame[8] = {SCS_ABORT};
    bits_put_le(&frame[1], s->index, 2);
    frame[3] = s->sub;
    bits_put_le(&frame[4], code, 4);
    s->aborts++;
    finish_transfer(s);
    s->io.send(s->io.ctx, frame, t_ns);
}

static void timed_out(void *ctx, int64_t t_ns)
{
    struct co_sdo *s = ctx;
    s->timeouts++;
    send_abort(s, CO_AB_TIMEOUT, t_ns);
}

void co_sdo_init(struct co_sdo *s, const struct co_od *od, const struct co_sdo_io *io, struct sched *sched)
{
    memset(s, 0, sizeof *s);
    s->od = od;
    s->io = *io;
    s->sched = sched;
    sched_ev(&s->timeout, timed_out, s);
}

void co_sdo_reset(struct co_sdo *s)
{
    finish_transfer(s);
}

static void wait_in(struct co_sdo *s, enum co_sdo_state state, int64_t t_ns)
{
    s->state = state;
    sched_at(s->sched, &s->timeout, t_ns + CO_SDO_TIMEOUT_NS);
}

/* ---- upload: server to client ---- */

static void send_value(struct co_sdo *s, const struct co_value *v, int64_t t_ns)
{
    uint8_t frame[8] = {SCS_UPLOAD | BIT_SIZE};
    bits_put_le(&frame[1], s->index, 2);
    frame[3] = s->sub;
    s->size = (uint16_t)co_encode(s->entry, v, s->buffer, sizeof s->buffer);
    s->at = 0;
    s->toggle = false;
    if (s->size > 0 && s->size <= EXPEDITED_MAX) {
        frame[0] = (uint8_t)(SCS_UPLOAD | BIT_EXPEDITED | BIT_SIZE | (EXPEDITED_MAX - s->size) << 2);
        memcpy(&frame[4], s->buffer, s->size);
        finish_transfer(s);
    } else {
        bits_put_le(&frame[4], s->size, 4);
        wait_in(s, CO_SDO_UPLOAD, t_ns);
    }
    s->io.send(s->io.ctx, frame, t_ns);
}

static void begin_upload(struct co_sdo *s, int64_t t_ns)
{
    if (co_may_read(s->entry) != CO_OK) {
        send_abort(s, CO_AB_WRITE_ONLY, t_ns);
        return;
    }
    wait_in(s, CO_SDO_READING, t_ns); /* before the access: its answer may come at any time from now */
    s->value = (struct co_value){0};
    const uint32_t result = s->io.read(s->io.ctx, s->entry, &s->value, t_ns);
    if (result == CO_PENDING) return;
    if (result == CO_OK) send_value(s, &s->value, t_ns);
    else send_abort(s, result, t_ns);
}

static void upload_segment(struct co_sdo *s, uint8_t command, int64_t t_ns)
{
    if (s->state != CO_SDO_UPLOAD) {
        send_abort(s, CO_AB_COMMAND, t_ns);
        return;
    }
    if (!(command & BIT_TOGGLE) != !s->toggle) {
        send_abort(s, CO_AB_TOGGLE, t_ns);
        return;
    }
    const unsigned left = (unsigned)s->size - s->at;
    const unsigned n = left < SEGMENT_MAX ? left : SEGMENT_MAX;
    uint8_t frame[8] = {SCS_UPLOAD_SEGMENT};
    frame[0] = (uint8_t)((s->toggle ? BIT_TOGGLE : 0) | (SEGMENT_MAX - n) << 1 | (n == left ? BIT_LAST : 0));
    memcpy(&frame[1], &s->buffer[s->at], n);
    s->at = (uint16_t)(s->at + n);
    s->toggle = !s->toggle;
    if (n == left) finish_transfer(s);
    else wait_in(s, CO_SDO_UPLOAD, t_ns);
    s->io.send(s->io.ctx, frame, t_ns);
}

/* ---- download: client to server ---- */

static void confirm_write(struct co_sdo *s, int64_t t_ns)
{
    uint8_t frame[8] = {SCS_DOWNLOAD};
    if (s->expedited) {
        bits_put_le(&frame[1], s->index, 2);
        frame[3] = s->sub;
    } else {
        frame[0] = (uint8_t)(SCS_DOWNLOAD_SEGMENT | (s->toggle ? BIT_TOGGLE : 0));
    }
    finish_transfer(s);
    s->io.send(s->io.ctx, frame, t_ns);
}

static void write_buffer(struct co_sdo *s, int64_t t_ns)
{
    s->value = (struct co_value){0};
    uint32_t result = co_decode(s->entry, s->buffer, s->size, &s->value);
    if (result == CO_OK) {
        wait_in(s, CO_SDO_WRITING, t_ns);
        result = s->io.write(s->io.ctx, s->entry, &s->value, t_ns);
    }
    if (result == CO_PENDING) return;
    if (result == CO_OK) confirm_write(s, t_ns);
    else send_abort(s, result, t_ns);
}

static void download_expedited(struct co_sdo *s, const uint8_t *data, int64_t t_ns)
{
    const unsigned named = EXPEDITED_MAX - (data[0] >> 2 & 3u);
    const size_t fits = co_type_size(s->entry->type);
    /* Without a length the data are as long as the type wants them. */
    s->size = (uint16_t)(data[0] & BIT_SIZE || fits == 0 ? named : fits);
    s->expedited = true;
    memcpy(s->buffer, &data[4], EXPEDITED_MAX);
    write_buffer(s, t_ns);
}

static void begin_download(struct co_sdo *s, const uint8_t *data, int64_t t_ns)
{
    if (co_may_write(s->entry) != CO_OK) {
        send_abort(s, CO_AB_READ_ONLY, t_ns);
        return;
    }
    if (data[0] & BIT_EXPEDITED) {
        download_expedited(s, data, t_ns);
        return;
    }
    s->announced = data[0] & BIT_SIZE ? (uint32_t)bits_get_le(&data[4], 4) : 0;
    if (s->announced > sizeof s->buffer) {
        send_abort(s, CO_AB_TOO_LONG, t_ns);
        return;
    }
    s->size = 0;
    s->toggle = false;
    s->expedited = false;
    uint8_t frame[8] = {SCS_DOWNLOAD};
    memcpy(&frame[1], &data[1], 3);
    wait_in(s, CO_SDO_DOWNLOAD, t_ns);
    s->io.send(s->io.ctx, frame, t_ns);
}

static void download_segment(struct co_sdo *s, const uint8_t *data, int64_t t_ns)
{
    if (s->state != CO_SDO_DOWNLOAD) {
        send_abort(s, CO_AB_COMMAND, t_ns);
        return;
    }
    if (!(data[0] & BIT_TOGGLE) != !s->toggle) {
        send_abort(s, CO_AB_TOGGLE, t_ns);
        return;
    }
    const unsigned n = SEGMENT_MAX - (data[0] >> 1 & 7u);
    if (s->size + n > sizeof s->buffer) {
        send_abort(s, CO_AB_TOO_LONG, t_ns);
        return;
    }
    memcpy(&s->buffer[s->size], &data[1], n);
    s->size = (uint16_t)(s->size + n);
    if (data[0] & BIT_LAST) {
        if (s->announced != 0 && s->announced != s->size) send_abort(s, CO_AB_LENGTH, t_ns);
        else write_buffer(s, t_ns);
        return;
    }
    const uint8_t frame[8] = {(uint8_t)(SCS_DOWNLOAD_SEGMENT | (s->toggle ? BIT_TOGGLE : 0))};
    s->toggle = !s->toggle;
    wait_in(s, CO_SDO_DOWNLOAD, t_ns);
    s->io.send(s->io.ctx, frame, t_ns);
}

/* ---- requests ---- */

/* A client that begins again has given up whatever was under way. */
static void begin_transfer(struct co_sdo *s, const uint8_t *data, int64_t t_ns)
{
    finish_transfer(s);
    s->index = (uint16_t)bits_get_le(&data[1], 2);
    s->sub = data[3];
    uint32_t abort = CO_OK;
    s->entry = co_find(s->od, s->index, s->sub, &abort);
    if (!s->entry) send_abort(s, abort, t_ns);
    else if (data[0] >> 5 == CCS_UPLOAD) begin_upload(s, t_ns);
    else begin_download(s, data, t_ns);
}

void co_sdo_request(struct co_sdo *s, const uint8_t *data, size_t len, int64_t t_ns)
{
    if (len != 8) {
        s->malformed++;
        return;
    }
    s->requests++;
    switch (data[0] >> 5) {
    case CCS_DOWNLOAD:
    case CCS_UPLOAD:
        begin_transfer(s, data, t_ns);
        return;
    case CCS_DOWNLOAD_SEGMENT:
        download_segment(s, data, t_ns);
        return;
    case CCS_UPLOAD_SEGMENT:
        upload_segment(s, data[0], t_ns);
        return;
    case CS_ABORT:
        finish_transfer(s);
        return;
    default: /* block transfer and undefined commands */
        s->index = (uint16_t)bits_get_le(&data[1], 2);
        s->sub = data[3];
        send_abort(s, CO_AB_COMMAND, t_ns);
    }
}

void co_sdo_answer(struct co_sdo *s, uint32_t ticket, uint32_t abort, const struct co_value *v, int64_t t_ns)
{
    const bool pending = s->state == CO_SDO_READING || s->state == CO_SDO_WRITING;
    if (!pending || ticket != s->ticket) return;
    if (abort != CO_OK) send_abort(s, abort, t_ns);
    else if (s->state == CO_SDO_WRITING) confirm_write(s, t_ns);
    else send_value(s, v, t_ns);
}
