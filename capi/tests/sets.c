/* Pairs between two sets, and skins, against the plain loop and the functions for one set. C99. */
#include "checks.h"

#include <math.h>

enum { FIRST = 300, SECOND = 200, ALL = FIRST + SECOND };

/* Whole thirty-seconds, so that the plain loop is exact. */
static void fill(float *rows, size_t count, uint32_t seed) {
    size_t k;
    for (k = 0; k < 4 * count; k++) {
        seed = seed * 1664525u + 1013904223u;
        rows[k] = (float)(seed >> 16 & (k % 4 == 3 ? 15u : 127u)) / 32.0f;
    }
}

static int overlap(const float *a, const float *b, float length) {
    double squared = 0, reach = (double)a[3] + b[3];
    int axis;
    for (axis = 0; axis < 3; axis++) {
        double d = (double)a[axis] - b[axis];
        if (length > 0) d -= length * floor(d / length + 0.5);
        squared += d * d;
    }
    return squared <= reach * reach;
}

/* Returns the pairs between two sets by the plain loop. */
static uint64_t expected_across(const float *a, const float *b, float length, lazygrid_pair *pairs) {
    uint64_t count = 0;
    uint32_t i, j;
    for (i = 0; i < FIRST; i++) {
        for (j = 0; j < SECOND; j++) {
            if (overlap(a + 4 * i, b + 4 * j, length)) {
                pairs[count].i = i;
                pairs[count++].j = j;
            }
        }
    }
    return count;
}

typedef struct {
    lazygrid_pair pairs[FIRST * SECOND];
    uint64_t count, largest, until;
} taken;

static int32_t take(void *context, const lazygrid_pair *pairs, size_t count) {
    taken *own = context;
    memcpy(own->pairs + own->count, pairs, count * sizeof *pairs);
    own->count += count;
    if (count > own->largest) own->largest = count;
    return own->count >= own->until;
}

static void each_result_is_that_of_the_plain_loop(int32_t algorithm, float length) {
    static float a[4 * FIRST], b[4 * SECOND];
    static lazygrid_pair expected[FIRST * SECOND];
    static taken all;
    lazygrid_spheres first = lazygrid_rows(FIRST, a), second = lazygrid_rows(SECOND, b);
    lazygrid_query query = lazygrid_across(&first, &second);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    const lazygrid_pair *pairs;
    const uint64_t *offsets;
    const uint32_t *indices;
    uint64_t count, wanted, right = 0, k;
    fill(a, FIRST, 1);
    fill(b, SECOND, 2);
    wanted = expected_across(a, b, length, expected);
    CHECK(wanted > 300 && wanted < FIRST * SECOND);
    settings.algorithm = algorithm;
    settings.periodic[0] = settings.periodic[1] = settings.periodic[2] = length;
    detector = detector_of(&settings);

    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK && count == wanted);
    CHECK(memcmp(pairs, expected, (size_t)wanted * sizeof *pairs) == 0);
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == wanted);
    CHECK(lazygrid_neighbors(detector, &query, &offsets, &indices) == LAZYGRID_OK);
    CHECK(offsets[0] == 0 && offsets[FIRST] == wanted);
    for (k = 0; k < wanted; k++) {
        right += indices[k] == expected[k].j && offsets[expected[k].i] <= k && k < offsets[expected[k].i + 1];
    }
    CHECK(right == wanted);
    all.count = all.largest = 0;
    all.until = UINT64_MAX;
    CHECK(lazygrid_stream(detector, &query, 64, take, &all, &count) == LAZYGRID_OK);
    CHECK(count == wanted && all.count == wanted && all.largest == 64);
    CHECK(memcmp(all.pairs, expected, (size_t)wanted * sizeof *expected) == 0);
    all.count = 0;
    all.until = 100;
    CHECK(lazygrid_stream(detector, &query, 64, take, &all, &count) == LAZYGRID_OK && count == 128);
    lazygrid_destroy(detector);
}

/* The pairs between the sets are the pairs among all spheres with one sphere of each set. */
static void one_set_of_both_says_the_same(void) {
    static float rows[4 * ALL];
    static uint32_t species[ALL];
    static lazygrid_pair expected[FIRST * SECOND];
    lazygrid_spheres all = lazygrid_rows(ALL, rows), first = all, second = all;
    lazygrid_query among = lazygrid_among(&all), query = lazygrid_across(&first, &second);
    lazygrid_settings settings = on_cpu();
    lazygrid_interactions *table;
    lazygrid_detector *detector;
    const lazygrid_pair *pairs;
    uint64_t count, wanted = 0, k;
    fill(rows, ALL, 3);
    for (k = 0; k < ALL; k++) species[k] = (uint32_t)k % 3;
    CHECK(lazygrid_interactions_create(3, LAZYGRID_TOUCH, 0, &table) == LAZYGRID_OK);
    CHECK(lazygrid_interactions_set(table, 0, 0, LAZYGRID_NEVER, 0) == LAZYGRID_OK);
    CHECK(lazygrid_interactions_set(table, 0, 1, LAZYGRID_WITHIN, 1.5) == LAZYGRID_OK);
    settings.interactions = table;
    detector = detector_of(&settings);
    lazygrid_interactions_destroy(table);
    all.species = first.species = species;
    first.count = FIRST;
    second = lazygrid_rows(SECOND, rows + 4 * FIRST);

    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_INPUT);
    CHECK(says(lazygrid_last_error(detector), "in the second set, "));
    second.species = species + FIRST;
    CHECK(lazygrid_pairs(detector, &among, &pairs, &count) == LAZYGRID_OK);
    for (k = 0; k < count; k++) {
        if (pairs[k].i < FIRST && pairs[k].j >= FIRST) {
            expected[wanted].i = pairs[k].i;
            expected[wanted++].j = pairs[k].j - FIRST;
        }
    }
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK);
    CHECK(wanted > 0 && count == wanted && memcmp(pairs, expected, (size_t)wanted * sizeof *pairs) == 0);
    lazygrid_destroy(detector);
}

static void the_second_set_is_named(void) {
    static const float good[] = {0, 0, 0, 1, 0.5f, 0, 0, 1}, bad[] = {0, 0, 0, 1, 0, 0, 0, -1};
    lazygrid_spheres first = lazygrid_rows(2, good), second = lazygrid_rows(2, bad);
    lazygrid_query query = lazygrid_across(&first, &second), turned = lazygrid_across(&second, &first);
    lazygrid_query same = lazygrid_across(&first, &first), broken = query;
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    const lazygrid_pair *pairs;
    uint64_t count = 7;
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_ERROR_INPUT);
    CHECK(pairs == NULL && count == 0);
    CHECK(says(lazygrid_last_error(detector), "in the second set, sphere 1"));
    CHECK(lazygrid_count(detector, &turned, &count) == LAZYGRID_ERROR_INPUT);
    CHECK(strstr(lazygrid_last_error(detector), "second set") == NULL);
    second.x = NULL;
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(detector), "in the second set, `x` is NULL"));
    broken.first = NULL;
    CHECK(lazygrid_count(detector, &broken, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(detector), "`query.first` is NULL"));
    CHECK(lazygrid_stream(detector, &same, 0, take, NULL, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_stream(detector, &same, 1, NULL, NULL, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_count(detector, &same, &count) == LAZYGRID_OK && count == 4);
    second.count = 0;
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK && count == 0);
    lazygrid_destroy(detector);
    settings.algorithm = LAZYGRID_ALGORITHM_HASH_GRID;
    detector = detector_of(&settings);
    CHECK(lazygrid_count(detector, &same, &count) == LAZYGRID_OK && count == 4);
    lazygrid_destroy(detector);
    settings = on_cpu();
    settings.max_pairs = 3;
    detector = detector_of(&settings);
    CHECK(lazygrid_pairs(detector, &same, &pairs, &count) == LAZYGRID_ERROR_TOO_MANY_PAIRS);
    CHECK(pairs == NULL && count == 4);
    lazygrid_destroy(detector);
}

static void a_skin_never_changes_an_answer(void) {
    enum { COUNT = 3000, STEPS = 12 };
    static float rows[4 * COUNT];
    static const int32_t skins[] = {LAZYGRID_SKIN_OFF, LAZYGRID_SKIN_AUTO, LAZYGRID_SKIN_FIXED};
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_detector *detectors[3];
    const lazygrid_pair *expected, *found;
    uint64_t count, others;
    int kept = 0, step, k;
    size_t at;
    for (k = 0; k < 3; k++) {
        lazygrid_settings settings = on_cpu();
        settings.skin = skins[k];
        if (skins[k] == LAZYGRID_SKIN_FIXED) settings.skin_distance = 0.125f;
        detectors[k] = detector_of(&settings);
    }
    fill(rows, COUNT, 4);
    for (at = 0; at < 4 * COUNT; at++) rows[at] *= at % 4 == 3 ? 1.0f : 4.0f;
    for (step = 0; step < STEPS; step++) {
        for (at = 0; at < 4 * COUNT; at++) rows[at] += at % 4 == 3 ? 0.0f : (at + (size_t)step) % 3 * 0.0078125f;
        CHECK(lazygrid_pairs(detectors[0], &query, &expected, &count) == LAZYGRID_OK && count > 100);
        for (k = 1; k < 3; k++) {
            const char *json;
            CHECK(lazygrid_pairs(detectors[k], &query, &found, &others) == LAZYGRID_OK && others == count);
            CHECK(memcmp(found, expected, (size_t)count * sizeof *found) == 0);
            CHECK(lazygrid_report_json(detectors[k], &json) == LAZYGRID_OK);
            kept += skins[k] == LAZYGRID_SKIN_FIXED && strstr(json, "\"rebuilt\":null") != NULL;
        }
    }
    CHECK(kept >= STEPS / 2 && kept < STEPS);
    for (k = 0; k < 3; k++) lazygrid_destroy(detectors[k]);
}

static void skins_are_refused(void) {
    static const float distances[] = {0, -1, 1e-20f, 1e30f, INFINITY, NAN};
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    size_t k;
    settings.skin = LAZYGRID_SKIN_FIXED;
    for (k = 0; k < sizeof distances / sizeof *distances; k++) {
        settings.skin_distance = distances[k];
        CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_SETTING && detector == NULL);
        CHECK(says(lazygrid_last_error(NULL), "skin = "));
    }
    settings.skin_distance = 0.5f;
    settings.algorithm = LAZYGRID_ALGORITHM_NAIVE;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_SETTING);
    settings.algorithm = LAZYGRID_ALGORITHM_AUTO;
    settings.skin = LAZYGRID_SKIN_OFF;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_SETTING);
    CHECK(says(lazygrid_last_error(NULL), "settings.skin_distance is 0.5"));
    settings.skin_distance = 0;
    settings.skin = 3;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(NULL), "settings.skin is 3"));
}

int main(void) {
    each_result_is_that_of_the_plain_loop(LAZYGRID_ALGORITHM_AUTO, 0);
    each_result_is_that_of_the_plain_loop(LAZYGRID_ALGORITHM_NAIVE, 0);
    each_result_is_that_of_the_plain_loop(LAZYGRID_ALGORITHM_CELL_LIST, 0);
    each_result_is_that_of_the_plain_loop(LAZYGRID_ALGORITHM_CELL_LIST, 4);
    each_result_is_that_of_the_plain_loop(LAZYGRID_ALGORITHM_ARRAY_GRID, 4);
    one_set_of_both_says_the_same();
    the_second_set_is_named();
    a_skin_never_changes_an_answer();
    skins_are_refused();
    printf("%d passed, %d failed\n", passed, failed);
    return failed != 0;
}
