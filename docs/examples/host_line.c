/* A host of a PSA-2 on INT, DATA and CLK, 8 million samples a second, that tells what it takes (docs/conform_host.md):
 * cc host_line.c -o host_line; ./host_line PORT [WORD_BITS CODE_BITS] */
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { INT = 1, DATA = 2, CLK = 4, MOST = 4 * 32, PERIOD = 8000, STALE = 250 * PERIOD, GLITCH = 40 };
static int64_t now, fall, before, heard,
    rise[MOST]; /* in samples; before: fall of the last frame, whole or torn, 0: none; heard: its end */
static int word_bits = 32, code_bits = 24, bits, listening, stale, over[3], same, frozen;
static uint32_t word[4];
static int32_t code[3];
static long long frames;

#define TELL(name, format, value) printf("{\"" name "\": " format "}\n", value)

static int whole(void) /* four words, evenly but for 4 periods more between words; the mean is the frame's own */
{
    double mean = (double)(rise[4 * word_bits - 1] - rise[0]) / (4 * word_bits - 1 + 3 * 4),
           slack = mean / 2 > 1 ? mean / 2 : 1;
    for (int i = 1; i < 4 * word_bits; i++) {
        double off = (double)(rise[i] - rise[i - 1]) - mean * (i % word_bits ? 1 : 5);
        if (off > slack || off < -slack) return 0;
    }
    return 1;
}

static void on_frame(void)
{
    int32_t last = 1 << (32 - word_bits), most = INT32_MAX >> (32 - code_bits);
    int32_t c[3] = {(int32_t)word[0] / last, (int32_t)word[1] / last, (int32_t)word[2] / last};
    unsigned t = word[3] >> (32 - word_bits), status = word_bits < 24 ? 1 : t >> 20 & 15; /* 16 bits: the code alone */
    if (status & 4) TELL("overrun", "%d", 1);
    if (!(status & 1)) return; /* not settled */
    same = memcmp(c, code, sizeof c) ? 0 : same + 1;
    memcpy(code, c, sizeof c);
    if (frozen != (same >= 999)) TELL("frozen", "%s", (frozen = !frozen) ? "true" : "false");
    for (int i = 0; i < 3; i++) {
        if (over[i] == (c[i] >= most || c[i] < -most)) continue;
        printf("{\"%s\": \"%c\"}\n", (over[i] = !over[i]) ? "over_range" : "in_range", "xyz"[i]);
    }
    printf("{\"frame\": %lld, \"x\": %d, \"y\": %d, \"z\": %d, \"t\": %d, \"channel\": %u, \"status\": %u, \"t_us\": "
           "%.3f}\n",
           frames++, c[0], c[1], c[2], (int16_t)t, t >> 16 & 15, status, (double)fall / 8);
}

static void on_rise(void) /* of INT: what was that? */
{
    if (!bits && now - fall < GLITCH) return;
    int64_t steps = before ? (fall - before + PERIOD / 2) / PERIOD : 1;
    if (steps > 1) TELL("lost", "%lld", (long long)steps - 1);
    before = fall, heard = now;
    if (stale) TELL("stale", "%s", (stale = 0, "false"));
    if (bits == 4 * word_bits && whole()) on_frame();
    else TELL("torn", "%d", 1);
}

static void on_sample(uint8_t b, uint8_t last)
{
    now++;
    if (last & ~b & INT) fall = now, bits = 0, listening = 1, memset(word, 0, sizeof word);
    if (listening && ~last & b & INT) on_rise();
    if (listening && !(b & INT) && ~last & b & CLK) {
        if (bits < 4 * word_bits) {
            rise[bits] = now;
            word[bits / word_bits] = word[bits / word_bits] >> 1 | (b & DATA ? 1U << 31 : 0);
        }
        bits += bits <= 4 * word_bits;
    }
    if (heard && !stale && now - heard > STALE) TELL("stale", "%s", (stale = 1, "true"));
}

int main(int argc, char **argv)
{
    static uint8_t block[1 << 16], last; /* INT low at first: a frame under way is not one */
    if (argc == 4) word_bits = atoi(argv[2]), code_bits = atoi(argv[3]);
    if (word_bits < 16 || word_bits > 32 || code_bits < 2 || code_bits > 32) argc = 0;
    int port = argc == 2 || argc == 4 ? open(argv[1], O_RDONLY | O_NOCTTY) : -1;
    if (port < 0) return perror("host_line PORT"), 2;
    for (ssize_t n; (n = read(port, block, sizeof block)) > 0; fflush(stdout)) {
        for (ssize_t i = 0; i < n; last = block[i++]) on_sample(block[i], last);
    }
    return TELL("end", "%s", "true"), 0;
}
