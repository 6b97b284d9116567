/* How fast a third-party driver can talk to a chip through libpsabench.
 *
 *     bench_lib CASE [BYTES]    prints: CASE bytes=N readings=M ns=T hash=H
 *
 * The hash is over what the chip answered. */
#include "api/psabench.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SCLK_HZ 1900000 /* CLKIN / 4 and a little: t1 */
#define T6_NS   7000    /* RDATA to the first data bit: 50 tau */
#define WAIT_NS 1000000000

struct lib {
    psabench *bench;
    psabench_part *adc;
    int drdy, cs;
    uint64_t bytes, readings, hash;
};

static void must(const struct lib *l, int result)
{
    if (result >= 0) return;
    (void)fprintf(stderr, "bench_lib: %s\n", psabench_error_text(l->bench));
    exit(3);
}

static void hash(struct lib *l, const uint8_t *rx, size_t n)
{
    for (size_t i = 0; i < n; i++) l->hash = (l->hash ^ rx[i]) * UINT64_C(0x100000001B3);
}

/* All eleven registers again and again, t6 between the bytes. */
static void registers(struct lib *l, uint64_t bytes)
{
    static const uint8_t tx[13] = {0x10, 0x0A};
    uint8_t rx[sizeof tx];
    must(l, psabench_spi_clock(l->adc, SCLK_HZ, T6_NS));
    for (; l->bytes < bytes; l->bytes += sizeof tx) {
        must(l, psabench_spi(l->adc, tx, rx, sizeof tx));
        hash(l, rx + 3, sizeof rx - 3); /* without STATUS, which holds DRDY */
    }
}

/* RDATA and three bytes at each conversion, as fast as they come. */
static void readings(struct lib *l, uint64_t bytes)
{
    static const uint8_t rdata = 0x01;
    uint8_t rx[3];
    must(l, psabench_spi_clock(l->adc, SCLK_HZ, 0));
    for (; l->bytes < bytes; l->bytes += 1 + sizeof rx, l->readings++) {
        must(l, psabench_run_until_level(l->adc, l->drdy, 1, WAIT_NS));
        must(l, psabench_run_until_level(l->adc, l->drdy, 0, WAIT_NS));
        must(l, psabench_spi(l->adc, &rdata, NULL, 1));
        must(l, psabench_run_for(l->bench, T6_NS));
        must(l, psabench_spi(l->adc, NULL, rx, sizeof rx));
        hash(l, rx, sizeof rx);
    }
}

/* The registers once more, bit by bit on the pins. */
static void pins(struct lib *l, uint64_t bytes)
{
    const int sclk = psabench_pin(l->adc, "SCLK"), din = psabench_pin(l->adc, "DIN"),
              dout = psabench_pin(l->adc, "DOUT");
    static const uint8_t tx[13] = {0x10, 0x0A};
    for (; l->bytes < bytes; l->bytes++) {
        uint8_t rx = 0;
        const unsigned at = (unsigned)(l->bytes % sizeof tx);
        for (int bit = 7; bit >= 0; bit--) {
            must(l, psabench_set(l->adc, sclk, 1));
            must(l, psabench_set(l->adc, din, tx[at] >> bit & 1));
            must(l, psabench_run_for(l->bench, 300));
            must(l, psabench_set(l->adc, sclk, 0));
            rx = (uint8_t)(rx << 1 | psabench_get(l->adc, dout));
            must(l, psabench_run_for(l->bench, 300));
        }
        must(l, psabench_run_for(l->bench, T6_NS));
        if (at > 2) hash(l, &rx, 1);
    }
}

static const struct lib_case {
    const char *name;
    void (*run)(struct lib *l, uint64_t bytes);
} cases[] = {{"spi", registers}, {"spi-pins", pins}, {"readings", readings}};

static void open_lib(struct lib *l)
{
    memset(l, 0, sizeof *l);
    l->bench = psabench_new(1);
    l->adc = l->bench ? psabench_part_new(l->bench, "ads1256", "adc", NULL) : NULL;
    if (!l->adc) exit(3);
    l->drdy = psabench_pin(l->adc, "DRDY");
    l->cs = psabench_pin(l->adc, "CS");
    must(l, psabench_set_volts(l->adc, 0, 1.0));
    must(l, psabench_run_until_level(l->adc, l->drdy, 0, WAIT_NS)); /* its self-calibration is over */
    must(l, psabench_set(l->adc, l->cs, 0));
}

static int64_t clock_ns(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* whatever else the machine is busy with */
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

static void run_case(const struct lib_case *c, uint64_t bytes)
{
    struct lib l;
    open_lib(&l);
    const int64_t t0_ns = clock_ns();
    c->run(&l, bytes);
    printf("%s bytes=%" PRIu64 " readings=%" PRIu64 " ns=%" PRId64 " hash=%016" PRIx64 "\n", c->name, l.bytes,
           l.readings, clock_ns() - t0_ns, l.hash);
    psabench_free(l.bench);
}

int main(int argc, char **argv)
{
    const uint64_t bytes = argc > 2 ? strtoull(argv[2], NULL, 10) : 10000;
    for (size_t i = 0; argc > 1 && i < sizeof cases / sizeof *cases; i++) {
        if (strcmp(argv[1], cases[i].name) != 0) continue;
        run_case(&cases[i], bytes);
        return 0;
    }
    (void)fprintf(stderr, "usage: bench_lib CASE [BYTES]; cases:");
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) (void)fprintf(stderr, " %s", cases[i].name);
    (void)fprintf(stderr, "\n");
    return 2;
}
