/* A driver for the ADS1256 and a program that reads a voltage with it.
 *
 * The driver touches hardware in four functions, hal_*. Here they are the simulated chip of libpsabench; on a board they are
 * the SPI of the microcontroller. Nothing else of the driver knows which it is.
 *
 *     cc examples/ads1256_read.c $(pkg-config --cflags --libs psabench) -o ads1256_read && ./ads1256_read run.vcd */
#include <psabench.h>

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* ---- hardware ---- */

static psabench_part *adc;

static void must(int result)
{
    if (result >= 0) return;
    (void)fprintf(stderr, "%s\n", psabench_error_text(psabench_of(adc)));
    exit(1);
}

static void hal_select(int on)
{
    must(psabench_set(adc, psabench_pin(adc, "CS"), !on));
}

static void hal_spi(const uint8_t *tx, uint8_t *rx, size_t n)
{
    must(psabench_spi(adc, tx, rx, n));
}

static void hal_wait_us(unsigned us)
{
    must(psabench_run_for(psabench_of(adc), us * INT64_C(1000)));
}

static void hal_wait_ready(void) /* DRDY low, within a second */
{
    must(psabench_run_until_level(adc, psabench_pin(adc, "DRDY"), 0, INT64_C(1000000000)));
}

/* ---- driver ---- */

enum { STATUS = 0, ADCON = 2, DRATE = 3 };
enum { RDATA = 0x01, RREG = 0x10, WREG = 0x50, SELFCAL = 0xF0, RESET = 0xFE };
enum { T6_US = 7 /* 50 clocks of 7.68 MHz from a command to its data */, T11_US = 4 /* to the next command */ };

static void command(uint8_t opcode)
{
    hal_select(1);
    hal_spi(&opcode, NULL, 1);
    hal_wait_us(T11_US);
    hal_select(0);
}

static void ads1256_write(uint8_t address, uint8_t value)
{
    const uint8_t bytes[] = {(uint8_t)(WREG | address), 0, value};
    hal_select(1);
    hal_spi(bytes, NULL, sizeof bytes);
    hal_wait_us(T11_US);
    hal_select(0);
}

static uint8_t ads1256_read(uint8_t address)
{
    const uint8_t bytes[] = {(uint8_t)(RREG | address), 0};
    uint8_t value;
    hal_select(1);
    hal_spi(bytes, NULL, sizeof bytes);
    hal_wait_us(T6_US);
    hal_spi(NULL, &value, 1);
    hal_wait_us(T11_US);
    hal_select(0);
    return value;
}

static void ads1256_init(void)
{
    command(RESET);
    hal_wait_ready();
    ads1256_write(ADCON, 0x01); /* PGA 2: +-2.5 V; clock output off */
    ads1256_write(DRATE, 0x82); /* 100 words a second */
    command(SELFCAL);           /* for this gain and rate */
    hal_wait_ready();
}

static double ads1256_volts(void)
{
    static const uint8_t rdata = RDATA;
    uint8_t b[3];
    hal_wait_ready();
    hal_select(1);
    hal_spi(&rdata, NULL, 1);
    hal_wait_us(T6_US);
    hal_spi(NULL, b, sizeof b);
    hal_wait_us(T11_US);
    hal_select(0);
    const int32_t code = (int32_t)((uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8) / 256;
    return code * 2.5 / 8388608.0;
}

/* ---- program ---- */

int main(int argc, char **argv)
{
    psabench *bench = psabench_new(1);
    adc = psabench_part_new(bench, "ads1256", "adc", "vref_v=2.5");
    if (!adc) {
        (void)fprintf(stderr, "%s\n", psabench_error_text(bench));
        return 1;
    }
    if (argc > 1) must(psabench_vcd(bench, argv[1]));
    must(psabench_set_volts(adc, 0, 1.875)); /* AIN0 */
    must(psabench_set_volts(adc, 1, 0.625)); /* AIN1 */

    ads1256_init();
    const unsigned id = ads1256_read(STATUS) >> 4;
    printf("ID %u, DRATE %02Xh\n", id, ads1256_read(DRATE));
    for (int i = 0; i < 3; i++) {
        const double volts = ads1256_volts();
        printf("%.3f ms: %.7f V\n", 1e-6 * (double)psabench_now_ns(bench), volts);
    }
    psabench_free(bench);
    return 0;
}
