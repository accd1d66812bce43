/* Tilted boxes, groups and excluded pairs against the plain loop. C99. */
#include "checks.h"

#include <math.h>

enum { COUNT = 160, SPLIT = 60, MOST = COUNT * COUNT };

/* Edges of a triclinic box, tilted by more than half an edge. Images more than four cell vectors away touch nothing
   here. */
static const double tilted[9] = {4, 0, 0, 3, 4, 0, -1, 2.5, 5};

/* Whole thirty-seconds, so that the plain loop is exact; coordinates may leave the triclinic box. */
static void fill(float *rows, uint32_t seed) {
    size_t k;
    for (k = 0; k < 4 * COUNT; k++) {
        seed = seed * 1664525u + 1013904223u;
        rows[k] = (float)(seed >> 16 & (k % 4 == 3 ? 15u : 127u)) / 32.0f;
    }
}

/* Returns 1 if any images touch; `cell_vectors` may be NULL. */
static int touch(const float *a, const float *b, const double *cell_vectors) {
    double reach = (double)a[3] + b[3];
    int far = cell_vectors == NULL ? 0 : 4, x, y, z, axis;
    for (x = -far; x <= far; x++) {
        for (y = -far; y <= far; y++) {
            for (z = -far; z <= far; z++) {
                double squared = 0;
                for (axis = 0; axis < 3; axis++) {
                    double d = (double)a[axis] - b[axis];
                    if (cell_vectors != NULL) {
                        d += (double)x * cell_vectors[axis] + (double)y * cell_vectors[3 + axis]
                            + (double)z * cell_vectors[6 + axis];
                    }
                    squared += d * d;
                }
                if (squared <= reach * reach) return 1;
            }
        }
    }
    return 0;
}

static int is_listed(const lazygrid_pair *list, size_t count, uint32_t i, uint32_t j, int either) {
    size_t k;
    for (k = 0; k < count; k++) {
        if ((list[k].i == i && list[k].j == j) || (either && list[k].i == j && list[k].j == i)) return 1;
    }
    return 0;
}

/* Exclusions of the plain loop; NULL for none. */
typedef struct {
    const uint32_t *groups;
    const lazygrid_pair *list;
    size_t listed;
} omitted;

static int is_omitted(const omitted *out, uint32_t i, uint32_t j, uint32_t group_i, uint32_t group_j, int either) {
    if (out->groups != NULL && group_i == group_j && group_i != LAZYGRID_NO_GROUP) return 1;
    return is_listed(out->list, out->listed, i, j, either);
}

static uint64_t plain_loop(const float *rows, const double *cell_vectors, const omitted *out, lazygrid_pair *pairs) {
    uint64_t count = 0;
    uint32_t i, j;
    for (i = 0; i < COUNT; i++) {
        for (j = i + 1; j < COUNT; j++) {
            uint32_t of_i = out->groups == NULL ? 0 : out->groups[i], of_j = out->groups == NULL ? 0 : out->groups[j];
            if (touch(rows + 4 * i, rows + 4 * j, cell_vectors) && !is_omitted(out, i, j, of_i, of_j, 1)) {
                pairs[count].i = i;
                pairs[count++].j = j;
            }
        }
    }
    return count;
}

static int32_t tally(void *context, const lazygrid_pair *pairs, size_t count) {
    (void)pairs;
    *(uint64_t *)context += count;
    return 0;
}

static void each_result_is(lazygrid_detector *detector, const lazygrid_query *query, const lazygrid_pair *expected,
                           uint64_t wanted) {
    const lazygrid_pair *pairs;
    const uint64_t *offsets;
    const uint32_t *indices;
    uint64_t count = 7, seen = 0;
    CHECK(lazygrid_pairs(detector, query, &pairs, &count) == LAZYGRID_OK && count == wanted);
    CHECK(memcmp(pairs, expected, (size_t)wanted * sizeof *pairs) == 0);
    CHECK(lazygrid_count(detector, query, &count) == LAZYGRID_OK && count == wanted);
    CHECK(lazygrid_neighbors(detector, query, &offsets, &indices) == LAZYGRID_OK && offsets[COUNT] == 2 * wanted);
    CHECK(lazygrid_stream(detector, query, 16, tally, &seen, &count) == LAZYGRID_OK && seen == wanted);
}

static void boxes_lean(void) {
    static float rows[4 * COUNT];
    static lazygrid_pair expected[MOST];
    static const omitted nothing = {NULL, NULL, 0};
    static const int32_t algorithms[] = {LAZYGRID_ALGORITHM_AUTO, LAZYGRID_ALGORITHM_NAIVE, LAZYGRID_ALGORITHM_HASH_GRID,
                                         LAZYGRID_ALGORITHM_CELL_LIST};
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    int repeating, k;
    fill(rows, 1);
    for (repeating = 1; repeating <= 3; repeating++) {
        double cell_vectors[9] = {0};
        uint64_t wanted;
        memcpy(cell_vectors, tilted, (size_t)repeating * 3 * sizeof *cell_vectors);
        wanted = plain_loop(rows, cell_vectors, &nothing, expected);
        CHECK(wanted > 100);
        for (k = 0; k < 4; k++) {
            lazygrid_settings settings = on_cpu();
            lazygrid_detector *detector;
            settings.cell_vectors = cell_vectors;
            settings.algorithm = algorithms[k];
            detector = detector_of(&settings);
            /* The detector has copied them. */
            cell_vectors[0] += 1;
            each_result_is(detector, &query, expected, wanted);
            cell_vectors[0] -= 1;
            lazygrid_destroy(detector);
        }
    }
}

static void edges_are_refused(void) {
    double cell_vectors[9] = {4, 0, 0, 8, 0, 0, 0, 0, 0};
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    settings.cell_vectors = cell_vectors;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_INPUT && detector == NULL);
    CHECK(says(lazygrid_last_error(NULL), "(4, 0, 0), (8, 0, 0)"));
    cell_vectors[3] = NAN;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_INPUT);
    cell_vectors[3] = 0;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_OK);
    lazygrid_destroy(detector);
    settings.periodic[1] = 2;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_SETTING);
    CHECK(says(lazygrid_last_error(NULL), "settings.periodic and settings.cell_vectors"));
    settings.periodic[1] = 0;
    settings.cell_vectors = (const double *)(const void *)((const char *)cell_vectors + 1);
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(NULL), "settings.cell_vectors"));
}

/* Every third touching pair, in either order, and one twice. */
static size_t some_of(const lazygrid_pair *pairs, uint64_t count, lazygrid_pair *list) {
    size_t listed = 0;
    uint64_t k;
    for (k = 0; k < count; k += 3) {
        list[listed].i = k % 2 == 0 ? pairs[k].i : pairs[k].j;
        list[listed++].j = k % 2 == 0 ? pairs[k].j : pairs[k].i;
    }
    list[listed] = list[0];
    return listed + 1;
}

static void what_is_left_out_is_no_pair(const double *cell_vectors) {
    static float rows[4 * COUNT];
    static uint32_t groups[COUNT];
    static lazygrid_pair expected[MOST], list[MOST];
    omitted out = {NULL, NULL, 0};
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    lazygrid_exclusions *exclusions;
    uint64_t all, wanted;
    size_t listed, k;
    fill(rows, 2);
    for (k = 3; k < 4 * COUNT; k += 4) rows[k] *= cell_vectors == NULL ? 3.0f : 1.0f;
    for (k = 0; k < COUNT; k++) groups[k] = k % 5 == 4 ? LAZYGRID_NO_GROUP : (uint32_t)k % 5;
    settings.cell_vectors = cell_vectors;
    detector = detector_of(&settings);
    all = plain_loop(rows, cell_vectors, &out, expected);
    listed = some_of(expected, all, list);

    out.groups = spheres.groups = groups;
    wanted = plain_loop(rows, cell_vectors, &out, expected);
    CHECK(wanted < all && wanted > all / 2);
    each_result_is(detector, &query, expected, wanted);

    CHECK(lazygrid_exclusions_create(COUNT, list, listed, &exclusions) == LAZYGRID_OK);
    out.list = list;
    out.listed = listed;
    query.exclusions = exclusions;
    wanted = plain_loop(rows, cell_vectors, &out, expected);
    each_result_is(detector, &query, expected, wanted);
    out.groups = spheres.groups = NULL;
    wanted = plain_loop(rows, cell_vectors, &out, expected);
    CHECK(wanted == all - (all + 2) / 3);
    each_result_is(detector, &query, expected, wanted);
    lazygrid_exclusions_destroy(exclusions);

    /* As columns, with all touching pairs excluded as neighbor lists. */
    {
        const uint64_t *offsets;
        const uint32_t *indices;
        query.exclusions = NULL;
        CHECK(lazygrid_neighbors(detector, &query, &offsets, &indices) == LAZYGRID_OK);
        CHECK(lazygrid_exclusions_from_csr(COUNT, offsets, indices, &exclusions) == LAZYGRID_OK);
        query.exclusions = exclusions;
        each_result_is(detector, &query, expected, 0);
        lazygrid_exclusions_destroy(exclusions);
    }
    lazygrid_destroy(detector);
}

static void two_sets_leave_out_the_same(void) {
    static float rows[4 * COUNT];
    static uint32_t groups[COUNT];
    static lazygrid_pair expected[MOST], list[MOST];
    lazygrid_spheres a = lazygrid_rows(SPLIT, rows), b = a;
    lazygrid_query query = lazygrid_across(&a, &b);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    lazygrid_exclusions *exclusions, *of_one;
    const lazygrid_pair *pairs;
    uint64_t count, wanted = 0;
    size_t listed = 0, k;
    uint32_t i, j;
    fill(rows, 3);
    for (k = 0; k < COUNT; k++) groups[k] = k % 4 == 3 ? LAZYGRID_NO_GROUP : (uint32_t)k % 4;
    b = lazygrid_rows(COUNT - SPLIT, rows + 4 * SPLIT);
    settings.cell_vectors = tilted;
    detector = detector_of(&settings);
    for (i = 0; i < SPLIT; i++) {
        for (j = 0; j < COUNT - SPLIT; j++) {
            if (!touch(rows + 4 * i, rows + 4 * (SPLIT + j), tilted)) continue;
            if ((i + j) % 4 == 0) {
                list[listed].i = i;
                list[listed++].j = j;
            } else if (groups[i] != groups[SPLIT + j] || groups[i] == LAZYGRID_NO_GROUP) {
                expected[wanted].i = i;
                expected[wanted++].j = j;
            }
        }
    }
    CHECK(wanted > 15 && listed > 10);
    CHECK(lazygrid_exclusions_across(SPLIT, COUNT - SPLIT, list, listed, &exclusions) == LAZYGRID_OK);
    a.groups = groups;
    b.groups = groups + SPLIT;
    query.exclusions = exclusions;
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK && count == wanted);
    CHECK(memcmp(pairs, expected, (size_t)wanted * sizeof *pairs) == 0);
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == wanted);

    CHECK(lazygrid_exclusions_create(COUNT - SPLIT, NULL, 0, &of_one) == LAZYGRID_OK);
    query.exclusions = of_one;
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_INPUT);
    lazygrid_exclusions_destroy(of_one);
    lazygrid_exclusions_destroy(exclusions);
    lazygrid_destroy(detector);
}

static void lists_are_refused(void) {
    static const float points[] = {0, 0, 0, 1, 0, 0, 0, 1};
    static const lazygrid_pair beyond[] = {{0, 1}, {1, 2}};
    static const uint64_t falling[] = {0, 2, 1}, far[] = {0, 1, UINT64_MAX};
    static const uint32_t indices[] = {1, 0};
    lazygrid_spheres spheres = lazygrid_rows(2, points);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    lazygrid_exclusions *list;
    uint64_t count;
    CHECK(lazygrid_exclusions_create(2, beyond, 2, &list) == LAZYGRID_ERROR_INPUT && list == NULL);
    CHECK(says(lazygrid_last_error(NULL), "(1, 2)"));
    CHECK(lazygrid_exclusions_create(2, NULL, 1, &list) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(NULL), "`pairs` is NULL"));
    CHECK(lazygrid_exclusions_create(2, beyond, 1, NULL) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_exclusions_create(2, beyond, (size_t)-1, &list) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_exclusions_create((size_t)-1, NULL, 0, &list) == LAZYGRID_ERROR_INPUT);
    CHECK(lazygrid_exclusions_across(1, 1, beyond, 1, &list) == LAZYGRID_ERROR_INPUT);
    CHECK(lazygrid_exclusions_from_csr(2, falling, indices, &list) == LAZYGRID_ERROR_INPUT && list == NULL);
    CHECK(lazygrid_exclusions_from_csr(2, far, indices, &list) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_exclusions_from_csr(2, NULL, indices, &list) == LAZYGRID_ERROR_ARGUMENT);
    /* Of other numbers of spheres. */
    CHECK(lazygrid_exclusions_create(3, beyond, 2, &list) == LAZYGRID_OK);
    query.exclusions = list;
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_INPUT && count == 0);
    CHECK(says(lazygrid_last_error(detector), "3"));
    lazygrid_exclusions_destroy(list);
    lazygrid_exclusions_destroy(NULL);
    lazygrid_destroy(detector);
}

int main(void) {
    boxes_lean();
    edges_are_refused();
    what_is_left_out_is_no_pair(NULL);
    what_is_left_out_is_no_pair(tilted);
    two_sets_leave_out_the_same();
    lists_are_refused();
    printf("%d passed, %d failed\n", passed, failed);
    return failed != 0;
}
