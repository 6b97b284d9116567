/* The lines of a CSV file are samples whose times rise, within their ranges, or are refused in one line. */
#include "fuzz.h"

#include "scenario/series_csv.h"

#include <math.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct series_csv csv;
    struct series_sample sample;
    char why[200];
    int64_t last_ns = INT64_MIN;
    const char *at = (const char *)data, *end = at + size;
    series_csv_init(&csv, "x_v");
    while (size && at < end) {
        const char *lf = memchr(at, '\n', (size_t)(end - at));
        const size_t n = (size_t)((lf ? lf : end) - at);
        const enum series_csv_line kind = series_csv_line(&csv, at, n, &sample, why, sizeof why);
        if (kind == SERIES_CSV_BAD) {
            assert(strncmp(why, "expected ", 9) == 0 && strlen(why) < sizeof why && !strchr(why, '\n'));
            break;
        }
        if (kind == SERIES_CSV_SAMPLE) {
            assert(sample.t_ns > last_ns && sample.t_ns <= SERIES_CSV_MOST_NS && sample.t_ns >= -SERIES_CSV_MOST_NS);
            assert(fabs(sample.value) <= SERIES_CSV_VALUE_MAX);
            last_ns = sample.t_ns;
        }
        at = lf ? lf + 1 : end;
    }
    return 0;
}
