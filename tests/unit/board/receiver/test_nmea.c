/* What leaves a receiver as text and packets: checksums of published messages, fields, bounds, the calendar. */
#include "rig.h"

#include "base/rng.h"
#include "board/receiver/nmea.h"
#include "board/receiver/ubx.h"

#include <string.h>

static struct report report_at(int32_t lat_e7, int32_t lon_e7)
{
    struct report r = {.fix = REPORT_FIX_3D, .leap_s = 18, .lat_e7 = lat_e7, .lon_e7 = lon_e7};
    r.h_mm = 150532;
    r.geoid_mm = 14500;
    r.sats = 8;
    r.hdop_e2 = 100;
    r.vdop_e2 = 150;
    r.v_n_mmps[0] = 30000;
    r.v_n_mmps[1] = -40000;
    r.v_n_mmps[2] = 5000;
    assert_true(calendar_parse("2026-01-05T12:34:56", &r.utc_ms));
    r.utc_ms += 780;
    return r;
}

static const char *sentence(const struct report *r, enum nmea_kind kind)
{
    static struct nmea s;
    nmea_write(r, kind, &s);
    assert_int_equal(strlen(s.text), s.len);
    assert_true(s.len <= NMEA_MAX && strcmp(s.text + s.len - 2, "\r\n") == 0);
    char sum[8];
    snprintf(sum, sizeof sum, "*%02X\r\n", nmea_checksum(s.text + 1, s.len - 6));
    assert_string_equal(s.text + s.len - 5, sum);
    s.text[s.len - 5] = '\0'; /* without it, to compare */
    return s.text;
}

/* ---- checksums */

static void checksums_are_those_of_published_sentences(void **state)
{
    static const char *const published[] = {
        "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47",
        "$GPGSA,A,3,04,05,,09,12,,,24,,,,,2.5,1.3,2.1*39",
        "$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A",
        "$GPVTG,054.7,T,034.4,M,005.5,N,010.2,K*48",
    };
    (void)state;
    for (unsigned i = 0; i < sizeof published / sizeof *published; i++) {
        const char *text = published[i];
        const size_t len = strlen(text);
        char sum[4];
        snprintf(sum, sizeof sum, "%02X", nmea_checksum(text + 1, len - 4));
        assert_string_equal(text + len - 2, sum);
    }
}

/* UBX-CFG-RATE for 5 Hz, as many drivers send it. */
static void the_checksum_of_a_packet_is_that_of_a_published_one(void **state)
{
    static const uint8_t packet[] = {0xB5, 0x62, 0x06, 0x08, 0x06, 0x00, 0xC8,
                                     0x00, 0x01, 0x00, 0x01, 0x00, 0xDE, 0x6A};
    uint8_t ck[2];
    (void)state;
    ubx_checksum(packet + 2, sizeof packet - 4, ck);
    assert_int_equal(ck[0], 0xDE);
    assert_int_equal(ck[1], 0x6A);
}

/* ---- fields */

static void sentences_have_their_fields(void **state)
{
    (void)state;
    const struct report r = report_at(557512345, 376100000);
    assert_string_equal(sentence(&r, NMEA_GGA),
                        "$GPGGA,123456.78,5545.07407,N,03736.60000,E,1,08,1.00,136.0,M,14.5,M,,");
    assert_string_equal(sentence(&r, NMEA_GSA), "$GPGSA,A,3,01,02,03,04,05,06,07,08,,,,,1.80,1.00,1.50");
    assert_string_equal(sentence(&r, NMEA_RMC),
                        "$GPRMC,123456.78,A,5545.07407,N,03736.60000,E,97.192,143.13,050126,,,A");
    assert_string_equal(sentence(&r, NMEA_VTG), "$GPVTG,143.13,T,,M,97.192,N,180.000,K,A");
    assert_string_equal(sentence(&r, NMEA_ZDA), "$GPZDA,123456.78,05,01,2026,00,00");
}

static void without_a_fix_fields_stay_empty(void **state)
{
    (void)state;
    struct report r = report_at(557512345, 376100000);
    r.fix = REPORT_NO_FIX;
    assert_string_equal(sentence(&r, NMEA_GGA), "$GPGGA,123456.78,,,,,0,00,99.99,,,,,,");
    assert_string_equal(sentence(&r, NMEA_GSA), "$GPGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99");
    assert_string_equal(sentence(&r, NMEA_RMC), "$GPRMC,123456.78,V,,,,,,,050126,,,N");
    assert_string_equal(sentence(&r, NMEA_VTG), "$GPVTG,,T,,M,,N,,K,N");
    assert_string_equal(sentence(&r, NMEA_ZDA), "$GPZDA,123456.78,05,01,2026,00,00");
}

static void a_course_at_rest_stays_empty(void **state)
{
    (void)state;
    struct report r = report_at(0, 0);
    r.v_n_mmps[0] = 99;
    r.v_n_mmps[1] = 0;
    assert_string_equal(sentence(&r, NMEA_VTG), "$GPVTG,,T,,M,0.192,N,0.356,K,A");
    r.v_n_mmps[0] = -100;
    assert_string_equal(sentence(&r, NMEA_VTG), "$GPVTG,270.00,T,,M,0.194,N,0.360,K,A");
}

static void places_at_the_edges_of_the_map(void **state)
{
    static const struct {
        int32_t lat_e7, lon_e7;
        const char *text;
    } rows[] = {
        {900000000, 1800000000, "9000.00000,N,18000.00000,E"},
        {-900000000, -1799999999, "9000.00000,S,17959.99999,W"},
        {0, 0, "0000.00000,N,00000.00000,E"},
        {-1, -1, "0000.00001,S,00000.00001,W"}, /* 0.6e-5 minutes */
        {599999999, 99999999, "5959.99999,N,00959.99999,E"},
        {10000000, -10000000, "0100.00000,N,00100.00000,W"},
        {19999999, -19999999, "0159.99999,N,00159.99999,W"},
    };
    (void)state;
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct report r = report_at(rows[i].lat_e7, rows[i].lon_e7);
        assert_memory_equal(sentence(&r, NMEA_GGA) + 17, rows[i].text, strlen(rows[i].text));
        assert_memory_equal(sentence(&r, NMEA_RMC) + 19, rows[i].text, strlen(rows[i].text));
    }
}

/* Whatever a report holds: sentence() looks at length and checksum. */
static void no_sentence_is_longer_than_82_characters(void **state)
{
    struct rng random = rng_stream(rig_seed(1), 0, "nmea");
    (void)state;
    for (unsigned i = 0; i < 20000; i++) {
        struct report r = report_at(0, 0);
        r.lat_e7 = (int32_t)(rng_u64(&random) % 1800000001u) - 900000000;
        r.lon_e7 = (int32_t)((int64_t)(rng_u64(&random) % 3600000000u) - 1799999999);
        r.h_mm = i % 3 ? (int32_t)rng_u64(&random) : INT32_MIN;
        r.geoid_mm = (int32_t)rng_u64(&random) / 4;
        for (unsigned k = 0; k < 3; k++) r.v_n_mmps[k] = i % 5 ? (int32_t)rng_u64(&random) : INT32_MIN;
        r.sats = (unsigned)(rng_u64(&random) % (REPORT_SATS_MAX + 1));
        r.hdop_e2 = (unsigned)(rng_u64(&random) % 10000);
        r.vdop_e2 = (unsigned)(rng_u64(&random) % 7000);
        r.utc_ms = (int64_t)(rng_u64(&random) % 4102444800000u);
        for (unsigned k = 0; k < NMEA_KINDS; k++) {
            const char *text = sentence(&r, (enum nmea_kind)k);
            assert_null(strstr(text, "60.000"));
        }
    }
}

static uint32_t u32_at(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static void a_packet_has_its_fields(void **state)
{
    (void)state;
    const struct report r = report_at(557512345, -376100000);
    uint8_t bytes[UBX_PVT_LEN], ck[2];
    ubx_write_pvt(&r, bytes);
    static const uint8_t head[] = {0xB5, 0x62, 0x01, 0x07, 92, 0};
    assert_memory_equal(bytes, head, sizeof head);
    ubx_checksum(bytes + 2, UBX_PVT_LEN - 4, ck);
    assert_memory_equal(bytes + UBX_PVT_LEN - 2, ck, 2);
    const uint8_t *p = bytes + 6;
    assert_int_equal(u32_at(p), 86400000 + 45296780 + 18000); /* Monday, GPS time */
    assert_int_equal(p[4] | p[5] << 8, 2026);
    assert_int_equal(u32_at(p + 16), 780000000);
    assert_int_equal(p[20], 3);
    assert_int_equal((int32_t)u32_at(p + 24), -376100000);
    assert_int_equal(u32_at(p + 28), 557512345);
    assert_int_equal(u32_at(p + 36), 136032);
    assert_int_equal((int32_t)u32_at(p + 48), -40000);
    assert_int_equal((int32_t)u32_at(p + 52), 30000);
    assert_int_equal((int32_t)u32_at(p + 56), -5000);
    assert_int_equal(u32_at(p + 60), 50000);
    assert_int_equal(u32_at(p + 64), 14313010);
}

/* ---- calendar */

static void gps_time_counts_from_its_epoch(void **state)
{
    static const struct {
        const char *utc;
        int leap_s;
        uint32_t week, tow_ms;
    } rows[] = {
        {"1980-01-06T00:00:00", 0, 0, 0},
        {"1999-08-21T23:59:47", 13, 1024, 0}, /* first rollover */
        {"2019-04-06T23:59:42", 18, 2048, 0}, /* second */
        {"2019-04-06T23:59:41", 18, 2047, 604799000},
        {"2024-02-29T12:00:00", 18, 2303, 388818000}, /* a Thursday */
        {"2026-01-05T00:00:00", 18, 2400, 86418000},
    };
    (void)state;
    for (unsigned i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct report r = {.leap_s = rows[i].leap_s};
        uint32_t week, tow_ms;
        assert_true(calendar_parse(rows[i].utc, &r.utc_ms));
        report_gps_time(&r, &week, &tow_ms);
        assert_int_equal(week, rows[i].week);
        assert_int_equal(tow_ms, rows[i].tow_ms);
    }
}

static void dates_that_there_are_not_are_rejected(void **state)
{
    static const char *const bad[] = {
        "",
        "2026-01-05",
        "2026-01-05 00:00:00",
        "2026-01-05T00:00:00Z",
        "2026-02-29T00:00:00",
        "2026-13-01T00:00:00",
        "2026-00-01T00:00:00",
        "2026-01-00T00:00:00",
        "2026-01-05T24:00:00",
        "2026-01-05T00:60:00",
        "2026-01-05T00:00:60",
        "1980-01-05T23:59:59",
        "2100-01-01T00:00:00",
        "-026-01-05T00:00:00",
        "2026-1-5T0:0:0",
        " 2026-01-05T00:00:00",
    };
    int64_t utc_ms = 42;
    (void)state;
    for (unsigned i = 0; i < sizeof bad / sizeof *bad; i++)
        if (calendar_parse(bad[i], &utc_ms)) fail_msg("\"%s\" is taken", bad[i]);
    assert_int_equal(utc_ms, 42);
    assert_true(calendar_parse("2024-02-29T23:59:59", &utc_ms));
}

static void each_day_of_four_centuries_comes_back(void **state)
{
    struct calendar before = calendar_of(-86400000LL);
    (void)state;
    for (int64_t day = 0; day < 146097; day++) {
        const struct calendar c = calendar_of(day * 86400000 + 1);
        assert_int_equal(calendar_utc_ms(&c), day * 86400000 + 1);
        assert_true(c.day == before.day + 1 || (c.day == 1 && before.day >= 28));
        before = c;
    }
    assert_int_equal(before.year, 2369);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(checksums_are_those_of_published_sentences),
        cmocka_unit_test(the_checksum_of_a_packet_is_that_of_a_published_one),
        cmocka_unit_test(sentences_have_their_fields),
        cmocka_unit_test(without_a_fix_fields_stay_empty),
        cmocka_unit_test(a_course_at_rest_stays_empty),
        cmocka_unit_test(places_at_the_edges_of_the_map),
        cmocka_unit_test(no_sentence_is_longer_than_82_characters),
        cmocka_unit_test(a_packet_has_its_fields),
        cmocka_unit_test(gps_time_counts_from_its_epoch),
        cmocka_unit_test(dates_that_there_are_not_are_rejected),
        cmocka_unit_test(each_day_of_four_centuries_comes_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
