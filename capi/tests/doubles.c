/* Spheres of doubles in memory of every layout, and refused layouts. C99. */
#include "checks.h"

#include <math.h>

/* Returns 1 if these spheres have one pair, (0, 1). */
static int is_one_pair(lazygrid_detector *detector, const lazygrid_spheres *spheres) {
    const lazygrid_query query = lazygrid_among(spheres);
    const lazygrid_pair *pairs;
    uint64_t count = 0;
    if (lazygrid_pairs(detector, &query, &pairs, &count) != LAZYGRID_OK) {
        fprintf(stderr, "%s\n", lazygrid_last_error(detector));
        return 0;
    }
    if (count != 1) fprintf(stderr, "%lu pairs\n", (unsigned long)count);
    return count == 1 && pairs[0].i == 0 && pairs[0].j == 1;
}

/* An array of structures. */
typedef struct {
    uint64_t id;
    double position[3];
    double velocity[3];
    double radius;
} particle;

typedef struct {
    float radius;
    uint32_t id;
    float x, y, z;
} small_particle;

/* The first two are tangent, the third is farther away. As floats all coincide. */
static const double exact[3][4] = {{1e9, 2e9, -1e9, 0.5}, {1e9 + 1, 2e9, -1e9, 0.5}, {1e9 - 1.0625, 2e9, -1e9, 0.5}};

static void doubles_of_every_layout_are_read_in_place(void) {
    static const double radius = 0.5;
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    double columns[4][3], centers[9], *centers_of[3];
    particle particles[3];
    lazygrid_spheres spheres;
    int k, axis;
    for (k = 0; k < 3; k++) {
        memset(&particles[k], 0xff, sizeof particles[k]);
        for (axis = 0; axis < 4; axis++) columns[axis][k] = exact[k][axis];
        for (axis = 0; axis < 3; axis++) centers[3 * k + axis] = particles[k].position[axis] = exact[k][axis];
        centers_of[k] = centers + 3 * k;
        particles[k].radius = exact[k][3];
    }
    spheres = lazygrid_rows_f64(3, exact[0]);
    CHECK(is_one_pair(detector, &spheres));
    spheres = lazygrid_columns_f64(3, columns[0], columns[1], columns[2], columns[3]);
    CHECK(is_one_pair(detector, &spheres));
    spheres = lazygrid_points_f64(3, centers, &radius);
    CHECK(is_one_pair(detector, &spheres));
    /* LAMMPS's layout: x[i][0..2] in one block. */
    spheres = lazygrid_strided(LAZYGRID_F64, 3, centers_of[0], centers_of[0] + 1, centers_of[0] + 2, 24, &radius, 0);
    CHECK(is_one_pair(detector, &spheres));
    spheres = lazygrid_strided(LAZYGRID_F64, 3, &particles[0].position[0], &particles[0].position[1],
                               &particles[0].position[2], sizeof(particle), &particles[0].radius, sizeof(particle));
    CHECK(is_one_pair(detector, &spheres));
    /* Points and a column of radii. */
    spheres = lazygrid_strided(LAZYGRID_F64, 3, centers, centers + 1, centers + 2, 24, columns[3], 8);
    CHECK(is_one_pair(detector, &spheres));
    /* Every other sphere. */
    spheres = lazygrid_strided(LAZYGRID_F64, 2, exact[0], &exact[0][1], &exact[0][2], 64, &radius, 0);
    {
        const lazygrid_query query = lazygrid_among(&spheres);
        uint64_t count = 7;
        CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == 0);
    }
    lazygrid_destroy(detector);
}

static void floats_of_every_layout_are_read_in_place(void) {
    static const float centers[] = {1, 10, 100, 2, 10, 100, 3.5f, 10, 100}, radius = 0.5f;
    static const float radii[] = {0.25f, 0.75f, 0.5f};
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    small_particle particles[3];
    lazygrid_spheres spheres;
    int k;
    for (k = 0; k < 3; k++) {
        memset(&particles[k], 0xff, sizeof particles[k]);
        particles[k].x = centers[3 * k];
        particles[k].y = centers[3 * k + 1];
        particles[k].z = centers[3 * k + 2];
        particles[k].radius = radii[k];
    }
    spheres = lazygrid_points(3, centers, &radius);
    CHECK(is_one_pair(detector, &spheres));
    spheres = lazygrid_strided(LAZYGRID_F32, 3, centers, centers + 1, centers + 2, 12, radii, 4);
    CHECK(is_one_pair(detector, &spheres));
    spheres = lazygrid_strided(LAZYGRID_F32, 3, &particles[0].x, &particles[0].y, &particles[0].z, sizeof(small_particle),
                               &particles[0].radius, sizeof(small_particle));
    CHECK(is_one_pair(detector, &spheres));
    /* Contiguous rows, except one number read from another array. As given, no two of them touch. */
    for (k = 0; k < 4; k++) {
        float apart[12], touching[12];
        const float *at[4];
        int number;
        for (number = 0; number < 12; number++) {
            touching[number] = number % 4 == 3 ? radii[number / 4] : centers[number / 4 * 3 + number % 4];
            apart[number] = touching[number];
            if (number % 4 == k) apart[number] = k == 3 ? 0.0f : 50.0f * (float)(number / 4);
        }
        for (number = 0; number < 4; number++) at[number] = apart + number;
        spheres = lazygrid_rows(3, apart);
        {
            const lazygrid_query query = lazygrid_among(&spheres);
            uint64_t count = 7;
            CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == 0);
        }
        at[k] = touching + k;
        spheres = lazygrid_strided(LAZYGRID_F32, 3, at[0], at[1], at[2], 16, at[3], 16);
        CHECK(is_one_pair(detector, &spheres));
    }
    lazygrid_destroy(detector);
}

static void two_sets_may_be_of_either_type(void) {
    static const double points[] = {1e9 + 1, 0, 0, 5, 0, 0};
    static const float rows[] = {4.5f, 0, 0, 0.25f, 1e9f, 0, 0, 0.75f};
    static const double radius = 0.25;
    const lazygrid_pair excluded[] = {{0, 1}};
    const lazygrid_spheres first = lazygrid_points_f64(2, points, &radius), second = lazygrid_rows(2, rows);
    lazygrid_query query = lazygrid_across(&first, &second);
    int32_t algorithm;
    lazygrid_exclusions *exclusions;
    CHECK(lazygrid_exclusions_across(2, 2, excluded, 1, &exclusions) == LAZYGRID_OK);
    for (algorithm = LAZYGRID_ALGORITHM_AUTO; algorithm <= LAZYGRID_ALGORITHM_CELL_LIST; algorithm++) {
        lazygrid_settings settings = on_cpu();
        lazygrid_detector *detector;
        const lazygrid_pair *pairs;
        const uint64_t *offsets;
        const uint32_t *indices;
        uint64_t count;
        settings.algorithm = algorithm;
        detector = detector_of(&settings);
        query.exclusions = NULL;
        CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK && count == 2);
        CHECK(pairs[0].i == 0 && pairs[0].j == 1 && pairs[1].i == 1 && pairs[1].j == 0);
        CHECK(lazygrid_neighbors(detector, &query, &offsets, &indices) == LAZYGRID_OK);
        CHECK(offsets[1] == 1 && offsets[2] == 2 && indices[0] == 1 && indices[1] == 0);
        query.exclusions = exclusions;
        CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK && count == 1 && pairs[0].i == 1);
        lazygrid_destroy(detector);
    }
    lazygrid_exclusions_destroy(exclusions);
}

/* Tangent across a length of 10.1, which is no float, but not across a length larger by 1e-9. */
static void lengths_are_not_rounded(void) {
    static const double rows[] = {0, 0, 0, 0.5, 9.1, 0, 0, 0.5};
    const lazygrid_spheres spheres = lazygrid_rows_f64(2, rows);
    const lazygrid_query query = lazygrid_among(&spheres);
    static const double lengths[] = {10.1, 10.100000001, 10.099999999};
    static const uint64_t expected[] = {1, 0, 1};
    int k;
    for (k = 0; k < 3; k++) {
        lazygrid_settings settings = on_cpu();
        lazygrid_detector *detector;
        double cell_vectors[9] = {0};
        uint64_t count;
        settings.periodic[0] = lengths[k];
        detector = detector_of(&settings);
        CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == expected[k]);
        lazygrid_destroy(detector);
        settings.periodic[0] = 0;
        cell_vectors[0] = lengths[k];
        settings.cell_vectors = cell_vectors;
        detector = detector_of(&settings);
        CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == expected[k]);
        lazygrid_destroy(detector);
    }
}

/* A distance that is tangent in doubles only. */
static void distances_are_not_rounded(void) {
    static const double rows[] = {0, 0, 0, 0, 0.1, 0, 0, 0}, distances[] = {0.1, 0.09999999999};
    static const uint32_t species[] = {0, 0};
    lazygrid_spheres spheres = lazygrid_rows_f64(2, rows);
    const lazygrid_query query = lazygrid_among(&spheres);
    int k;
    spheres.species = species;
    for (k = 0; k < 2; k++) {
        lazygrid_settings settings = on_cpu();
        lazygrid_interactions *table;
        lazygrid_detector *detector;
        uint64_t count;
        CHECK(lazygrid_interactions_create(1, LAZYGRID_WITHIN, distances[k], &table) == LAZYGRID_OK);
        settings.interactions = table;
        detector = detector_of(&settings);
        CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == (k == 0));
        lazygrid_destroy(detector);
        lazygrid_interactions_destroy(table);
    }
}

/* Returns 1 if a search of these spheres is LAZYGRID_ERROR_ARGUMENT with this message. */
static int is_refused(lazygrid_detector *detector, const lazygrid_spheres *spheres, const char *text) {
    const lazygrid_query query = lazygrid_among(spheres);
    uint64_t count = 7;
    return lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_ARGUMENT && count == 0
           && says(lazygrid_last_error(detector), text);
}

static void steps_and_types_are_refused(void) {
    static const double rows[12] = {0};
    const lazygrid_spheres good = lazygrid_rows_f64(3, rows);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    lazygrid_spheres bad = good;
    bad.step = 12;
    CHECK(is_refused(detector, &bad, "`step` is 12; it must be a multiple of 8"));
    bad = good;
    bad.r_step = 4;
    CHECK(is_refused(detector, &bad, "`r_step` is 4; it must be a multiple of 8"));
    bad = good;
    bad.step = 0;
    CHECK(is_refused(detector, &bad, "`step` is 0 for 3 spheres"));
    bad.count = 1;
    {
        const lazygrid_query query = lazygrid_among(&bad);
        uint64_t count = 7;
        CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == 0);
    }
    bad = good;
    bad.step = SIZE_MAX - 7;
    CHECK(is_refused(detector, &bad, "more than memory can hold"));
    bad.step = SIZE_MAX / 4 - SIZE_MAX / 4 % 8;
    bad.count = 1000;
    CHECK(is_refused(detector, &bad, "more than memory can hold"));
    bad = good;
    bad.r_step = (size_t)1 << (8 * sizeof(size_t) - 2);
    CHECK(is_refused(detector, &bad, "`r_step` is "));
    bad = good;
    bad.type = 2;
    CHECK(is_refused(detector, &bad, "`type` is 2; choose LAZYGRID_F32 or LAZYGRID_F64"));
    bad = good;
    bad.zero = 1;
    CHECK(is_refused(detector, &bad, "`zero` is 1"));
    bad = good;
    bad.y = (const char *)bad.y + 1;
    CHECK(is_refused(detector, &bad, "`y` is at"));
    bad = good;
    bad.r = NULL;
    CHECK(is_refused(detector, &bad, "`r` is NULL"));
    lazygrid_destroy(detector);
}

static void sizes_are_refused(void) {
    static const float rows[] = {0, 0, 0, 1, 0, 0, 0, 1};
    struct {
        lazygrid_spheres known;
        uint64_t newer;
    } spheres;
    struct {
        lazygrid_query known;
        uint64_t newer;
    } query;
    static const size_t sizes[] = {0, 8, sizeof(lazygrid_spheres) - 1, 100000};
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    uint64_t count;
    size_t k;
    spheres.known = lazygrid_rows(2, rows);
    query.known = lazygrid_among(&spheres.known);
    spheres.newer = query.newer = 0;
    for (k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        spheres.known.size = sizes[k];
        CHECK(is_refused(detector, &spheres.known, "query.first.size is "));
        CHECK(says(lazygrid_last_error(detector), "sizeof(lazygrid_spheres)"));
    }
    spheres.known.size = sizeof spheres;
    query.known.size = sizeof query;
    CHECK(lazygrid_count(detector, &query.known, &count) == LAZYGRID_OK && count == 1);
    spheres.newer = 1;
    CHECK(is_refused(detector, &spheres.known, "query.first has "));
    spheres.known.size = sizeof spheres.known;
    query.newer = 1;
    CHECK(lazygrid_count(detector, &query.known, &count) == LAZYGRID_ERROR_ARGUMENT && count == 0);
    CHECK(says(lazygrid_last_error(detector), "query has "));
    query.known.size = sizeof query.known - 1;
    CHECK(lazygrid_count(detector, &query.known, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(detector), "sizeof(lazygrid_query)"));
    query.known = lazygrid_across(&spheres.known, &spheres.known);
    query.known.second = (const lazygrid_spheres *)(const void *)((const char *)&spheres.known + 1);
    CHECK(lazygrid_count(detector, &query.known, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(detector), "in the second set, `query.second` is at"));
    lazygrid_destroy(detector);
}

static void bad_doubles_are_named(void) {
    static const double rows[] = {0, 0, 0, 1, 0, INFINITY, 0, 1, 0, 0, 0, -1e-300};
    const lazygrid_spheres spheres = lazygrid_rows_f64(3, rows);
    const lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    uint64_t count;
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_INPUT && count == 0);
    CHECK(says(lazygrid_last_error(detector), "sphere 1"));
    CHECK(says(lazygrid_last_error(detector), "2 of 3"));
    lazygrid_destroy(detector);
}

int main(void) {
    doubles_of_every_layout_are_read_in_place();
    floats_of_every_layout_are_read_in_place();
    two_sets_may_be_of_either_type();
    lengths_are_not_rounded();
    distances_are_not_rounded();
    steps_and_types_are_refused();
    sizes_are_refused();
    bad_doubles_are_named();
    printf("%d passed, %d failed\n", passed, failed);
    return failed != 0;
}
