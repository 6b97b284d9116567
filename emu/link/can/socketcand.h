/* Text messages of the socketcand protocol, raw mode.
 *
 *   server: < hi >  < ok >  < echo >  < frame 185 1.250000 1122334455667788 >  < error 20000004 1.250000 words >
 *   client: < open can0 >  < rawmode >  < send 605 8 40 8 10 0 0 0 0 0 >  < echo >
 *
 * An identifier of 3 digits is an 11-bit one, of 8 digits a 29-bit one. The time is simulated seconds. An error carries
 * a class of linux/can/error.h, so that python-can shows an error frame, and a text. Frames are classic only:
 * the protocol has no remote and no FD form. Broadcast manager, ISO-TP and statistics modes are not modelled. Pure. */
#ifndef PSABENCH_LINK_CAN_SOCKETCAND_H
#define PSABENCH_LINK_CAN_SOCKETCAND_H

#include "base/can/can.h"

#include <stddef.h>
#include <stdint.h>

#define SOCKETCAND_MSG_MAX     200u /* python-can rejects a longer one */
#define SOCKETCAND_CHANNEL_MAX 32u

enum socketcand_verb { SOCKETCAND_OPEN, SOCKETCAND_RAWMODE, SOCKETCAND_SEND, SOCKETCAND_ECHO };

enum socketcand_err {
    SOCKETCAND_OK,
    SOCKETCAND_SYNTAX,  /* no '<' at the start, or no word in it */
    SOCKETCAND_UNKNOWN, /* unknown word */
    SOCKETCAND_MODE,    /* a mode of real socketcand that is not modelled */
    SOCKETCAND_ARGS,    /* too few or too many words */
    SOCKETCAND_ID,
    SOCKETCAND_FD,    /* length above 8 */
    SOCKETCAND_DATA,  /* a data byte is not one or two hexadecimal digits */
    SOCKETCAND_LENGTH /* not as many data bytes as announced: what a remote frame looks like, too */
};

/* Error classes of linux/can/error.h in the form < error > carries them. */
#define SOCKETCAND_LOST    UINT32_C(0x20000004) /* CAN_ERR_CRTL: frames for this client were dropped */
#define SOCKETCAND_REFUSED UINT32_C(0x20000008) /* CAN_ERR_PROT: a message of this client was rejected */

#define SOCKETCAND_ERROR_FLAG UINT32_C(0x20000000) /* with the classes of can_node.error */

struct socketcand_msg {
    enum socketcand_verb verb;
    char channel[SOCKETCAND_CHANNEL_MAX]; /* open */
    struct can_msg frame;                 /* send */
};

/* msg is everything before the closing '>'; blanks around '<' are tolerated. out is untouched on error. */
enum socketcand_err socketcand_decode(const char *msg, size_t len, struct socketcand_msg *out);

/* Text for an error message of the bus (can_error.h). */
const char *socketcand_error_text(const struct can_msg *m);

/* `<where>: expected <what>`, without angle brackets. */
const char *socketcand_strerror(enum socketcand_err err);

/* Whole messages. pad > 0: blanks before the closing '>' make the length a multiple of pad, so that a client reading
 * blocks of a multiple of pad never sees a cut message. 0 when cap is too small or the frame has no such form. */
size_t socketcand_frame(const struct can_msg *m, int64_t t_ns, size_t pad, char *out, size_t cap);
size_t socketcand_error(uint32_t class, int64_t t_ns, const char *text, size_t pad, char *out, size_t cap);

#endif
