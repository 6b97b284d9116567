/* Lines of the BeagleLogic TCP protocol, as libsigrok's driver `beaglelogic` sends them. Pure.
 *
 *     version                    BeagleLogic 1.0
 *     samplerate [HZ]            10 to 100000000
 *     sampleunit [0|1]           0: samples of 16 bits, little-endian, 1: of 8 bits, channels 0 to 7
 *     triggerflags [0|1]         0: one-shot, 1: continuous; the client counts the samples in both
 *     memalloc [BYTES]           size of the instrument's memory, kept for the client, which ends a one-shot capture there
 *     bufunitsize [BYTES]        of a buffer: samples are lost in multiples of it
 *     get                        samples from now on, raw, until
 *     close
 *
 * A word without a number answers the number, one with a number `ok`; get and close answer nothing. What is wrong is answered
 * by `<where>: expected <what>, got <value>`: anything but `ok` is an error for the client. LF ends a line, a CR before it
 * and further NULs are ignored. */
#ifndef PSABENCH_LINK_LOGIC_BEAGLE_TEXT_H
#define PSABENCH_LINK_LOGIC_BEAGLE_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BEAGLE_CHANNELS   14u  /* of libsigrok's driver */
#define BEAGLE_LINE_MAX   80u  /* characters of a line */
#define BEAGLE_ANSWER_MAX 256u /* of an answer with its LF and NUL */

#define BEAGLE_HZ_MIN     10u
#define BEAGLE_HZ_MAX     100000000u
#define BEAGLE_MEMORY_MAX 2147483646u /* an int in the client */
#define BEAGLE_BUFFER_MIN 1024u
#define BEAGLE_BUFFER_MAX 4194304u

struct beagle_settings {
    uint32_t hz;
    uint32_t unit; /* enum beagle_unit */
    uint32_t continuous;
    uint32_t memory_bytes, buffer_bytes;
};

enum beagle_unit { BEAGLE_16_BITS, BEAGLE_8_BITS };

/* What the line asks for beside its answer. REJECTED: nothing, the answer is an error. */
enum beagle_action { BEAGLE_ANSWERED, BEAGLE_GET, BEAGLE_CLOSE, BEAGLE_REJECTED };

struct beagle_settings beagle_settings(void); /* after a client has connected */

/* Carries out one line without its LF; line NULL: it was too long. The answer with its LF, *n characters, 0: none. */
enum beagle_action beagle_text_line(struct beagle_settings *s, const char *line, size_t len,
                                    char answer[BEAGLE_ANSWER_MAX], size_t *n);

#endif
