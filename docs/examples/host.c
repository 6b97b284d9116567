/* A host of a PSA-2 on CAN that tells what it takes (docs/conform_host.md): cc host.c -o host; ./host ADDRESS:PORT NODE */
#include "socketcand.h"

static const uint8_t setup[6][5] =
    {/* object, what of it counts, as the article's set-up leaves it; 1018h: who is there */
     {0x18, 0x10, 1, 0x00, 0x00}, {0x00, 0x20, 2, 0xFF, 0x56}, {0x03, 0x20, 2, 0xFF, 0x56},
     {0x04, 0x20, 2, 0xFF, 0x56}, {0x01, 0x20, 1, 0x04, 0x04}, {0x01, 0x20, 4, 0xFF, 0x82}};
enum { ROWS = 6, AGAIN_MS = 20, ANSWER_MS = 1000, STALE_MS = 250, GONE_MS = 3500 };
static struct state {
    int started, half, begun, stale, frozen, over[3];
    int odd, same;                                               /* samples out of time, equal codes; in a row */
    unsigned row, seq, stamp;                                    /* asked for, in setup; of the last sample */
    int64_t ask_ms, sample_ms, t_us, steps, mark_us, mark_steps; /* ask_ms: when to ask (again), 0: not */
    int32_t code[3];
    uint8_t xy[8], zt[8];
} s;
static int can, node, gone;
static int64_t beat_ms;

#define TELL(name, format, value) printf("{\"" name "\": " format "}\n", value)

static void on_answer(const uint8_t *d)
{
    const uint8_t *row = setup[s.row];
    if (!s.ask_ms || memcmp(d + 1, row, 3)) return;   /* an answer to somebody else */
    if (d[0] == 0x80) s.ask_ms = now_ms() + AGAIN_MS; /* not now: the board is at its set-up */
    if ((d[0] & 0xE0) != 0x40) return;
    s.ask_ms = 0;
    if ((d[4] & row[3]) != row[4]) return (void)printf("{\"wrong_setup\": \"%04X:%d\"}\n", U16(row), row[2]);
    s.started = ++s.row == ROWS;
    if (s.started) can_send(can, 0, (uint8_t[]){1, (uint8_t)node}, 2); /* NMT start */
    else s.ask_ms = 1;                                                 /* the next, at once */
}

static void on_sample(const uint8_t *z, int fresh) /* fresh: there was silence before it */
{
    unsigned seq = U16(s.xy + 6), stamp = U16(z + 6), steps = (seq - s.seq) & 0xFFFF;
    int64_t due = steps * 250LL, ticks = (stamp - s.stamp) & 0xFFFF; /* of 4 us */
    ticks += (due - ticks + 32768) / 65536 * 65536;
    if (s.begun && !steps) return; /* it came twice */
    int odd = s.begun && (steps > 32767 || (!fresh && llabs(ticks - due) > 200 + steps / 2));
    s.odd = odd ? s.odd + 1 : 0;
    if (odd && s.odd < 8) return (void)TELL("torn", "%d", 1); /* halves of two samples */
    if (s.begun && !odd && steps > 1) TELL("lost", "%u", steps - 1);
    if (s.begun && !odd) s.t_us += 4 * ticks, s.steps += steps;
    s.begun = 1, s.seq = seq, s.stamp = stamp;
    if (fresh) s.mark_us = s.t_us, s.mark_steps = s.steps;
    if (s.steps - s.mark_steps >= 500) { /* the data rate, by the board's own times */
        long long ppm = (s.t_us - s.mark_us) * 1000 / (s.steps - s.mark_steps) - 1000000;
        if (llabs(ppm) > 1000) TELL("rate_ppm", "%lld", ppm);
        s.mark_us = s.t_us, s.mark_steps = s.steps;
    }
    if (z[5] & 4) TELL("overrun", "%d", 1);
    if (!(z[5] & 1)) return; /* not settled */
    int32_t code[3] = {S24(s.xy), S24(s.xy + 3), S24(z)};
    s.same = memcmp(code, s.code, sizeof code) ? 0 : s.same + 1;
    memcpy(s.code, code, sizeof code);
    if (s.frozen != (s.same >= 999)) TELL("frozen", "%s", (s.frozen = !s.frozen) ? "true" : "false");
    for (int i = 0; i < 3; i++) {
        if (s.over[i] == (code[i] == 0x7FFFFF || code[i] == -0x800000)) continue;
        printf("{\"%s\": \"%c\"}\n", (s.over[i] = !s.over[i]) ? "over_range" : "in_range", "xyz"[i]);
    }
    printf("{\"frame\": %u, \"x\": %d, \"y\": %d, \"z\": %d, \"t\": %d, \"channel\": %d, \"t_us\": %lld}\n", seq,
           code[0], code[1], code[2], (int16_t)U16(z + 3), z[5] >> 4, (long long)s.t_us);
}

static void on_frame(int id, const uint8_t *d, int n)
{
    if (id == 0x080 + node && n == 8) TELL("emcy", "%u", U16(d));
    if (id == 0x580 + node && n == 8) on_answer(d);
    if (id == 0x700 + node && n == 1) {
        beat_ms = now_ms(), gone = 0;
        if (!d[0] && s.started) TELL("restart", "%s", "true");
        if (!d[0]) s = (struct state){.ask_ms = now_ms() + AGAIN_MS};
    }
    if (id == 0x180 + node && s.started) {
        if (n != 8 || (s.half && memcmp(s.xy, d, 8))) TELL("torn", "%d", 1);
        if ((s.half = n == 8)) memcpy(s.xy, d, 8);
    }
    if (id == 0x280 + node && s.started && (s.half || memcmp(s.zt, d, 8))) { /* not what came just before */
        int fresh = s.stale;
        if (fresh) TELL("stale", "%s", "false");
        s.stale = 0, s.sample_ms = now_ms();
        if (n == 8 && s.half) on_sample(d, fresh);
        else TELL("torn", "%d", 1);
        s.half = 0, memcpy(s.zt, d, 8);
    }
}

int main(int argc, char **argv)
{
    if (argc != 3 || (can = can_open(argv[1])) < 0) return fprintf(stderr, "usage: host ADDRESS:PORT NODE\n"), 2;
    node = atoi(argv[2]), s.ask_ms = 1;
    while (can_wait(can, 10, on_frame)) {
        int64_t now = now_ms();
        if (s.ask_ms && now >= s.ask_ms) {
            can_send(can, 0x600 + node,
                     (uint8_t[]){0x40, setup[s.row][0], setup[s.row][1], setup[s.row][2], 0, 0, 0, 0}, 8);
            s.ask_ms = now + ANSWER_MS;
        }
        if (s.begun && !s.stale && now - s.sample_ms > STALE_MS) TELL("stale", "%s", (s.stale = 1, "true"));
        if (beat_ms && !gone && now - beat_ms > GONE_MS) TELL("gone", "%s", (gone = 1, "true"));
        fflush(stdout);
    }
    return TELL("end", "%s", "true"), 0;
}
