/* A host in C: connects to the bus, unpacks PSA2_XY with the code that cantools makes from the DBC file, counts what is lost.
 *
 *     cantools generate_c_source --output-directory build/run --database-name psabench proto/psabench.dbc
 *     cc -Ibuild/run -Idocs/examples examples/can/host.c build/run/psabench.c -o build/run/host
 *     build/run/host 127.0.0.1:29536 1000
 *
 * docs/examples/host.c is a whole navigation computer's end: set-up, supervision, restart. */
#include "socketcand.h"

#include "psabench.h"

static long wanted, samples, lost;
static double sum_v;

static void take(int id, const uint8_t *data, int bytes)
{
    static int seq = -1;
    struct psabench_psa2_xy_t m;
    if (samples >= wanted) return; /* one look at the link may bring several frames */
    if (id != PSABENCH_PSA2_XY_FRAME_ID || psabench_psa2_xy_unpack(&m, data, (size_t)bytes) != 0) return;
    if (seq >= 0) lost += (uint16_t)(m.seq - seq - 1);
    seq = m.seq;
    samples++;
    sum_v += psabench_psa2_xy_x_decode(m.x);
}

int main(int argc, char *argv[])
{
    if (argc != 3) return fputs("usage: host ADDRESS:PORT SAMPLES\n", stderr), 2;
    wanted = atol(argv[2]);
    const int link = can_open(argv[1]);
    if (link < 0) return 3;
    can_send(link, 0x000, (const uint8_t[]){0x01, 5}, 2); /* NMT: start node 5 */
    for (const int64_t end_ms = now_ms() + 60000; samples < wanted && now_ms() < end_ms;)
        if (!can_wait(link, 1000, take)) return fputs("host: expected frames, got the end of the link\n", stderr), 3;
    printf("%ld samples, %ld lost, mean of X %.3f V\n", samples, lost, samples ? sum_v / (double)samples : 0.0);
    return close(link);
}
