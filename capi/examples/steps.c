/*
 * A simulation in C: spheres diffuse, and each step finds the overlapping pairs.
 *
 *     cc steps.c $(pkg-config --cflags --libs lazygrid) -Wl,-rpath,$(pkg-config --variable=libdir lazygrid) -lm && ./a.out
 */
#include <lazygrid.h>

#include <stdio.h>
#include <stdlib.h>

enum { SPHERES = 10000, STEPS = 10 };

/* A number between -1 and 1, reproducible. */
static float random_number(uint32_t *state) {
    *state = *state * 1664525u + 1013904223u;
    return (float)(int32_t)*state / 2147483648.0f;
}

static void fail(const char *what, const char *why) {
    fprintf(stderr, "%s: %s\n", what, why);
    exit(1);
}

int main(void) {
    /* x, y, z, r of each sphere, in a cube of edge 40. */
    static float rows[4 * SPHERES];
    uint32_t state = 1;
    uint64_t pairs_in_all = 0;
    lazygrid_settings settings;
    lazygrid_detector *detector;
    size_t k;
    int step;

    for (k = 0; k < 4 * SPHERES; k++) rows[k] = k % 4 == 3 ? 0.4f : 20.0f * random_number(&state);

    lazygrid_settings_init(&settings, sizeof settings);
    settings.order = LAZYGRID_ORDER_UNORDERED;
    if (lazygrid_create(&settings, &detector) != LAZYGRID_OK) fail("no detector", lazygrid_last_error(NULL));

    for (step = 0; step < STEPS; step++) {
        const lazygrid_spheres spheres = lazygrid_rows(SPHERES, rows);
        const lazygrid_query query = lazygrid_among(&spheres);
        const lazygrid_pair *pairs;
        uint64_t count;
        if (lazygrid_pairs(detector, &query, &pairs, &count) != LAZYGRID_OK) {
            fail("no pairs", lazygrid_last_error(detector));
        }
        /* Here a simulator would let pairs[0] to pairs[count - 1] collide or react. They live until the next search. */
        for (k = 0; k < count; k++) {
            if (pairs[k].i >= pairs[k].j) fail("no pairs", "an index is not below the other");
        }
        pairs_in_all += count;
        for (k = 0; k < 4 * SPHERES; k++) {
            if (k % 4 != 3) rows[k] += 0.1f * random_number(&state);
        }
    }
    printf("%d spheres, %d steps, %.1f pairs a step\n", SPHERES, STEPS, (double)pairs_in_all / STEPS);
    lazygrid_destroy(detector);
    return 0;
}
