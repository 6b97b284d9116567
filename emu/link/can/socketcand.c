#include "link/can/socketcand.h"

#include "base/hex.h"

#include <string.h>

struct words {
    const char *p, *end;
};

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
}

/* Next word of the message; false at its end. */
static bool next_word(struct words *w, const char **word, size_t *len)
{
    while (w->p < w->end && is_blank(*w->p)) w->p++;
    *word = w->p;
    while (w->p < w->end && !is_blank(*w->p)) w->p++;
    *len = (size_t)(w->p - *word);
    return *len > 0;
}

static bool word_is(const char *word, size_t len, const char *text)
{
    return len == strlen(text) && memcmp(word, text, len) == 0;
}

static enum socketcand_err no_more(struct words *w)
{
    const char *word;
    size_t len;
    return next_word(w, &word, &len) ? SOCKETCAND_ARGS : SOCKETCAND_OK;
}

static enum socketcand_err decode_open(struct words *w, struct socketcand_msg *m)
{
    const char *word;
    size_t len;
    if (!next_word(w, &word, &len) || len >= SOCKETCAND_CHANNEL_MAX) return SOCKETCAND_ARGS;
    for (size_t i = 0; i < len; i++)
        if (word[i] <= ' ' || word[i] > '~') return SOCKETCAND_ARGS; /* names of interfaces; it goes into messages */
    memcpy(m->channel, word, len);
    m->channel[len] = '\0';
    return no_more(w);
}

static enum socketcand_err decode_id(const char *word, size_t len, struct can_msg *m)
{
    const int64_t id = hex_get(word, len);
    if (len != 8 && len != 3) return SOCKETCAND_ID;
    if (id < 0 || id > (len == 8 ? 0x1FFFFFFF : 0x7FF)) return SOCKETCAND_ID;
    m->id = (uint32_t)id;
    m->flags = len == 8 ? CAN_EXT : 0;
    return SOCKETCAND_OK;
}

static enum socketcand_err decode_data(struct words *w, struct can_msg *m)
{
    const char *word;
    size_t len;
    for (unsigned i = 0; i < m->len; i++) {
        if (!next_word(w, &word, &len)) return SOCKETCAND_LENGTH;
        const int64_t byte = len <= 2 ? hex_get(word, len) : -1;
        if (byte < 0) return SOCKETCAND_DATA;
        m->data[i] = (uint8_t)byte;
    }
    return next_word(w, &word, &len) ? SOCKETCAND_LENGTH : SOCKETCAND_OK;
}

static enum socketcand_err decode_send(struct words *w, struct socketcand_msg *m)
{
    const char *word;
    size_t len;
    if (!next_word(w, &word, &len)) return SOCKETCAND_ARGS;
    const enum socketcand_err err = decode_id(word, len, &m->frame);
    if (err) return err;
    if (!next_word(w, &word, &len)) return SOCKETCAND_ARGS;
    const int64_t bytes = len <= 2 ? hex_get(word, len) : -1;
    if (bytes < 0) return SOCKETCAND_ARGS;
    if (bytes > 8) return SOCKETCAND_FD;
    m->frame.len = (uint8_t)bytes;
    return decode_data(w, &m->frame);
}

static const struct {
    const char *word;
    enum socketcand_verb verb;
    enum socketcand_err (*decode)(struct words *w, struct socketcand_msg *m); /* NULL: takes no arguments */
} verbs[] = {
    {"open", SOCKETCAND_OPEN, decode_open},
    {"rawmode", SOCKETCAND_RAWMODE, NULL},
    {"send", SOCKETCAND_SEND, decode_send},
    {"echo", SOCKETCAND_ECHO, NULL},
};

static const char *const other_modes[] = {
    "bcmmode", "isotpmode", "controlmode", "add",        "update",  "delete",
    "filter",  "subscribe", "unsubscribe", "statistics", "sendpdu",
};

static enum socketcand_err unknown_word(const char *word, size_t len)
{
    for (unsigned i = 0; i < sizeof other_modes / sizeof other_modes[0]; i++) {
        if (word_is(word, len, other_modes[i])) return SOCKETCAND_MODE;
    }
    return SOCKETCAND_UNKNOWN;
}

enum socketcand_err socketcand_decode(const char *msg, size_t len, struct socketcand_msg *out)
{
    struct words w = {msg, msg + len};
    const char *word;
    size_t n;
    if (!next_word(&w, &word, &n) || word[0] != '<') return SOCKETCAND_SYNTAX;
    w.p = word + 1; /* "<open" without a blank is tolerated */
    if (!next_word(&w, &word, &n)) return SOCKETCAND_SYNTAX;
    for (unsigned i = 0; i < sizeof verbs / sizeof verbs[0]; i++) {
        if (!word_is(word, n, verbs[i].word)) continue;
        struct socketcand_msg m = {.verb = verbs[i].verb};
        const enum socketcand_err err = verbs[i].decode ? verbs[i].decode(&w, &m) : no_more(&w);
        if (!err) *out = m;
        return err;
    }
    return unknown_word(word, n);
}

const char *socketcand_strerror(enum socketcand_err err)
{
    static const char *const text[] = {
        [SOCKETCAND_OK] = "no error",
        [SOCKETCAND_SYNTAX] = "message: expected an opening angle bracket and a word",
        [SOCKETCAND_UNKNOWN] = "message: expected open, rawmode, send or echo",
        [SOCKETCAND_MODE] = "mode: expected rawmode; other modes are not modelled",
        [SOCKETCAND_ARGS] = "arguments: expected open CHANNEL, or send ID LENGTH BYTES",
        [SOCKETCAND_ID] = "identifier: expected 3 digits up to 7FF or 8 digits up to 1FFFFFFF",
        [SOCKETCAND_FD] = "length: expected 0 to 8; use slcan or SocketCAN for FD frames",
        [SOCKETCAND_DATA] = "data: expected bytes of one or two hexadecimal digits",
        [SOCKETCAND_LENGTH] = "data: expected as many bytes as the length says; remote frames are not supported",
    };
    return text[err];
}

const char *socketcand_error_text(const struct can_msg *m)
{
    if (m->id & CAN_CLASS_BUS_OFF) return "this node is off the bus";
    if (m->id & CAN_CLASS_RESTARTED) return "this node is back from bus-off";
    if (m->id & CAN_CLASS_PROTOCOL) return "an error frame on the bus";
    if (m->data[1] & CAN_CONTROLLER_ACTIVE) return "this node is error-active";
    const bool warning = m->data[1] & (CAN_CONTROLLER_RX_WARNING | CAN_CONTROLLER_TX_WARNING);
    return warning ? "this node is in error warning" : "this node is error-passive";
}

/* Appends text; false when it does not fit. */
static bool put_text(char **p, const char *end, const char *text, size_t len)
{
    if ((size_t)(end - *p) < len) return false;
    memcpy(*p, text, len);
    *p += len;
    return true;
}

/* " S.UUUUUU " with the time in seconds, rounded down to a microsecond. */
static bool put_time(char **p, const char *end, int64_t t_ns)
{
    char digits[32];
    char *d = digits + sizeof digits;
    uint64_t us = t_ns > 0 ? (uint64_t)t_ns / 1000 : 0;
    *--d = ' ';
    for (int i = 0; i < 6; i++, us /= 10) *--d = (char)('0' + us % 10);
    *--d = '.';
    do {
        *--d = (char)('0' + us % 10);
        us /= 10;
    } while (us);
    *--d = ' ';
    return put_text(p, end, d, (size_t)(digits + sizeof digits - d));
}

/* Closes the message that began at out; 0 when it does not fit. */
static size_t close_message(char *out, char *p, const char *end, size_t pad)
{
    const size_t bare = (size_t)(p - out) + 2;
    const size_t len = pad ? (bare + pad - 1) / pad * pad : bare;
    if (len > (size_t)(end - out)) return 0;
    memset(p, ' ', len - bare);
    memcpy(out + len - 2, " >", 2);
    return len;
}

size_t socketcand_frame(const struct can_msg *m, int64_t t_ns, size_t pad, char *out, size_t cap)
{
    char *p = out;
    const char *end = out + cap;
    if (m->flags & (CAN_FD | CAN_RTR | CAN_ERROR) || m->len > 8) return 0;
    char id[8];
    const size_t id_digits = m->flags & CAN_EXT ? 8 : 3;
    hex_put(id, m->id, id_digits);
    if (!put_text(&p, end, "< frame ", 8) || !put_text(&p, end, id, id_digits) || !put_time(&p, end, t_ns)) return 0;
    char data[16];
    for (unsigned i = 0; i < m->len; i++) hex_put(data + 2 * i, m->data[i], 2);
    if (!put_text(&p, end, data, 2u * m->len)) return 0;
    return close_message(out, p, end, pad);
}

size_t socketcand_error(uint32_t class, int64_t t_ns, const char *text, size_t pad, char *out, size_t cap)
{
    char *p = out;
    const char *end = out + cap;
    char id[8];
    hex_put(id, class, 8);
    if (!put_text(&p, end, "< error ", 8) || !put_text(&p, end, id, 8) || !put_time(&p, end, t_ns)) return 0;
    if (!put_text(&p, end, text, strlen(text))) return 0;
    return close_message(out, p, end, pad);
}
