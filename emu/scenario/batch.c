/* The production batch of quartz sensors: a file of proto/batches, or a mapping with the same keys. */
#include "scenario/keys.h"

#include <stdio.h>
#include <string.h>

// clang-format off
static const struct field batch_rows[] = {
#define ROW(name_, lo, hi, words) REAL_ROW(struct quartz_batch, name_, lo, hi, words)
    {.key = "name", .type = FIELD_TEXT, .offset = offsetof(struct quartz_batch, name), .max = 32, .what = "of the batch"},
    ROW(share_a,                 0, 1,      "share of the article's group (a)"),
    ROW(share_b,                 0, 1,      "share of its group (b); the rest has a straight line"),
    ROW(curve_min_ug,            0, 1e6,    "least deviation of the bias over temperature"),
    ROW(curve_max_ug,            0, 1e6,    "greatest"),
    ROW(centre_min_degc,         -100, 200, "least temperature at which the deviation changes sign"),
    ROW(centre_max_degc,         -100, 200, "greatest"),
    ROW(width_min_k,             1, 1000,   "least distance from there to the greatest deviation"),
    ROW(width_max_k,             1, 1000,   "greatest"),
    ROW(slope_ug_per_k,          0, 1e4,    "linear part of the bias of both groups, standard deviation"),
    ROW(rest_slope_min_ug_per_k, 0, 1e4,    "least slope of the rest, either sign"),
    ROW(rest_slope_max_ug_per_k, 0, 1e4,    "greatest"),
    ROW(zero_min_ug,             0.001, 1e6, "least bias at 30 °C, either sign"),
    ROW(zero_max_ug,             0.001, 1e6, "greatest"),
    ROW(ratio_min,               1, 1e6,    "least ratio of the greatest bias over -60 to +85 °C to that at 30 °C"),
    ROW(ratio_max,               1, 1e6,    "greatest"),
    ROW(scale_tc_ppm_per_k,      0, 1e4,    "temperature coefficient of the scale, standard deviation"),
    ROW(scale_curve_ppm,         0, 1e5,    "deviation of the scale by the curve, standard deviation"),
    ROW(base_slope_arcsec_per_k, 0, 100,    "linear part of the tilt towards y, standard deviation"),
    ROW(base_curve_arcsec,       0, 3600,   "deviation of the tilt by the curve, standard deviation"),
    ROW(position_urad,           0, 1e4,    "position of the pendulum after sealing, standard deviation"),
    ROW(glue_ug,                 0, 1e5,    "bias by the glue before the first cycle, mean size, either sign"),
    ROW(glue_ppm,                0, 1e5,    "scale by the glue"),
    ROW(glue_arcsec,             0, 3600,   "tilt towards y by the glue"),
    ROW(glue_spread,             0, 3,      "standard deviation of the logarithm of the three"),
    ROW(glue_correlation,        0, 1,      "between the logarithms of two of the three"),
    ROW(glue_keep,               0.001, 1,  "part of the stress that a cycle leaves, median"),
    ROW(glue_keep_spread,        0, 1,      "standard deviation of its logarithm"),
    ROW(start_ug,                0, 1e5,    "scatter of the bias from start to start, rms"),
    ROW(start_ppm,               0, 1e5,    "scatter of the scale"),
    ROW(start_arcsec,            0, 3600,   "scatter of the tilt towards y"),
    ROW(zero_tolerance_ug,       0, 1e6,    "largest change of the bias from start to start in acceptance; for reports alone"),
    ROW(scale_tolerance_ppm,     0, 1e6,    "of the scale"),
    ROW(base_tolerance_arcsec,   0, 3600,   "of the tilt towards y"),
#undef ROW
};
const struct fields scenario_batch_fields = FIELDS(batch_rows);
// clang-format on

static const struct {
    const char *least, *most;
} pairs[] = {{"curve_min_ug", "curve_max_ug"}, {"centre_min_degc", "centre_max_degc"},
             {"width_min_k", "width_max_k"},   {"rest_slope_min_ug_per_k", "rest_slope_max_ug_per_k"},
             {"zero_min_ug", "zero_max_ug"},   {"ratio_min", "ratio_max"}};

static double value_of(const struct quartz_batch *b, const char *key)
{
    return *(const double *)(const void *)((const char *)b + fields_find(&scenario_batch_fields, key)->offset);
}

enum { SAMPLES = 30 };

/* Whether a group that there is gives ratios within the limits: drawn as if all units were of it. */
static bool check_group(struct yaml_file *f, const struct yaml_node *node, const struct quartz_batch *b,
                        enum quartz_group group, double share)
{
    struct quartz_batch alone = *b;
    alone.share_a = group == QUARTZ_GROUP_A;
    alone.share_b = group == QUARTZ_GROUP_B;
    for (uint32_t i = 0; share > 0.0 && i < SAMPLES; i++) {
        struct quartz_g g = quartz_default();
        if (!quartz_batch_draw(&alone, 0, i, 0, &g))
            return yaml_file_fail(f, yaml_at(node, "ratio_max"), "ratio_max",
                                  "expected curves and slopes that give ratios of %g to %g, got none in group %s",
                                  b->ratio_min, b->ratio_max, quartz_group_name(group));
    }
    return true;
}

static bool check_batch(struct yaml_file *f, const struct yaml_node *node, const struct quartz_batch *b)
{
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        const double least = value_of(b, pairs[i].least), most = value_of(b, pairs[i].most);
        if (least > most)
            return yaml_file_fail(f, yaml_at(node, pairs[i].most), pairs[i].most, "expected %s = %g or more, got %g",
                                  pairs[i].least, least, most);
    }
    if (b->share_a + b->share_b > 1.0)
        return yaml_file_fail(f, yaml_at(node, "share_b"), "share_b", "expected up to 1 with share_a, got %g",
                              b->share_a + b->share_b);
    return check_group(f, node, b, QUARTZ_GROUP_A, b->share_a) && check_group(f, node, b, QUARTZ_GROUP_B, b->share_b) &&
           check_group(f, node, b, QUARTZ_REST, 1.0 - b->share_a - b->share_b);
}

static bool open_batch(struct yaml_file *f, const struct yaml_node *node, struct quartz_batch *b)
{
    char path[FIND_PATH_MAX];
    struct yaml_file of;
    if (!yaml_find_proto(f, node, "quartz", "batches", yaml_scalar(node), path)) return false;
    if (!yaml_file_open(&of, path, f->why, f->cap)) return false;
    const bool ok = yaml_load(&of, of.root, "", &scenario_batch_fields, b) && check_batch(&of, of.root, b);
    yaml_file_close(&of);
    return ok;
}

bool scenario_load_batch(struct yaml_file *f, const struct yaml_node *node, void *section)
{
    struct scenario_spread *s = section;
    s->quartz_given = true;
    if (yaml_scalar(node)) return open_batch(f, node, &s->quartz);
    if (node->kind != YAML_MAPPING)
        return yaml_file_expected(f, node, "quartz", "a name of proto/batches, a path, or a mapping");
    if (!yaml_load(f, node, "quartz", &scenario_batch_fields, &s->quartz)) return false;
    const size_t outer = strlen(f->where);
    snprintf(f->where + outer, sizeof f->where - outer, "quartz.");
    if (!check_batch(f, node, &s->quartz)) return false;
    f->where[outer] = '\0';
    return true;
}

/* Every key: the dump needs no other file. */
void scenario_dump_batch(const struct field *d, const void *section, cJSON *to)
{
    const struct scenario_spread *s = section;
    if (s->quartz_given) yaml_dump(&scenario_batch_fields, &s->quartz, cJSON_AddObjectToObject(to, d->key));
}
