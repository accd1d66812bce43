/*
 * The GPU finds the CPU's pairs and reports its cost. Skipped without an adapter, unless LAZYGRID_REQUIRE_GPU is set.
 */
#include <lazygrid.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { COUNT = 3000 };

/* Whole eighths, so that distances are exact and both agree for tangent spheres. */
static void fill(float *rows) {
    uint32_t state = 1;
    size_t k;
    for (k = 0; k < 4 * COUNT; k++) {
        state = state * 1664525u + 1013904223u;
        rows[k] = k % 4 == 3 ? 0.25f : (float)(state >> 16 & 127u) / 8.0f;
    }
}

static lazygrid_status on(int32_t backend, lazygrid_detector **detector) {
    lazygrid_settings settings;
    lazygrid_settings_init(&settings, sizeof settings);
    settings.backend = backend;
    return lazygrid_create(&settings, detector);
}

static int fail(const char *what, const char *why) {
    fprintf(stderr, "%s: %s\n", what, why);
    return 1;
}

int main(void) {
    static float rows[4 * COUNT];
    const lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    const lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_detector *cpu, *gpu;
    lazygrid_status status;
    const lazygrid_pair *expected, *found;
    uint64_t count, others;
    const char *json;

    fill(rows);
    if (on(LAZYGRID_BACKEND_CPU, &cpu) != LAZYGRID_OK) return fail("no detector", lazygrid_last_error(NULL));
    status = on(LAZYGRID_BACKEND_GPU, &gpu);
    if (status != LAZYGRID_OK) {
        lazygrid_destroy(cpu);
        if (status != LAZYGRID_ERROR_GPU_UNAVAILABLE || getenv("LAZYGRID_REQUIRE_GPU") != NULL) {
            return fail("no detector on the GPU", lazygrid_last_error(NULL));
        }
        printf("skipped: %s\n", lazygrid_last_error(NULL));
        return 0;
    }
    if (lazygrid_pairs(cpu, &query, &expected, &count) != LAZYGRID_OK) return fail("CPU", lazygrid_last_error(cpu));
    if (lazygrid_pairs(gpu, &query, &found, &others) != LAZYGRID_OK) return fail("GPU", lazygrid_last_error(gpu));
    if (count == 0 || count != others || memcmp(expected, found, (size_t)count * sizeof *found) != 0) {
        return fail("GPU", "its pairs are others");
    }
    if (lazygrid_report_json(gpu, &json) != LAZYGRID_OK) return fail("report", lazygrid_last_error(gpu));
    if (strstr(json, "\"dispatches\":") == NULL) return fail("no cost in the report", json);
    printf("%s\n%lu pairs by both\n", json, (unsigned long)count);
    lazygrid_destroy(cpu);
    lazygrid_destroy(gpu);
    return 0;
}
