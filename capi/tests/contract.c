/*
 * The header's promises, one per function. Returns 0 and prints "N passed, 0 failed", or names the line. Built as C99,
 * so that the header stays within it.
 */
#include "checks.h"

#include <math.h>

/* Half a unit apart, of radius 0.3: each touches the next. */
static float *line(size_t count) {
    float *rows = malloc(4 * count * sizeof *rows);
    size_t k;
    if (rows == NULL) exit(1);
    for (k = 0; k < count; k++) {
        rows[4 * k] = 0.5f * (float)k;
        rows[4 * k + 1] = rows[4 * k + 2] = 0.0f;
        rows[4 * k + 3] = 0.3f;
    }
    return rows;
}

static void rows_and_columns_give_the_same(void) {
    static const float x[] = {0, 1.5f, 9}, zero[] = {0, 0, 0}, r[] = {1, 1, 0.1f};
    static const float rows[] = {0, 0, 0, 1, 1.5f, 0, 0, 1, 9, 0, 0, 0.1f};
    lazygrid_spheres given[2];
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    int k;
    given[0] = lazygrid_rows(3, rows);
    given[1] = lazygrid_columns(3, x, zero, zero, r);
    for (k = 0; k < 2; k++) {
        const lazygrid_query query = lazygrid_among(&given[k]);
        const lazygrid_pair *pairs = NULL;
        uint64_t count = 0;
        CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK);
        CHECK(count == 1 && pairs[0].i == 0 && pairs[0].j == 1);
        CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == 1);
    }
    CHECK(strcmp(lazygrid_last_error(detector), "") == 0);
    CHECK(lazygrid_destroy(detector) == LAZYGRID_OK);
}

static void none_and_one_are_ordinary(void) {
    static const float one[] = {0, 0, 0, 1};
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    lazygrid_spheres spheres = lazygrid_rows(0, NULL);
    lazygrid_query query = lazygrid_among(&spheres);
    const lazygrid_pair *pairs;
    const uint64_t *offsets;
    const uint32_t *indices;
    uint64_t count = 7;
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK && count == 0);
    CHECK(lazygrid_neighbors(detector, &query, &offsets, &indices) == LAZYGRID_OK && offsets[0] == 0);
    spheres = lazygrid_rows(1, one);
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_OK && count == 0);
    CHECK(lazygrid_neighbors(detector, &query, &offsets, &indices) == LAZYGRID_OK && offsets[1] == 0);
    lazygrid_destroy(detector);
}

static void neighbors_are_in_both_lists(void) {
    enum { COUNT = 1000 };
    float *rows = line(COUNT);
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    const uint64_t *offsets;
    const uint32_t *indices;
    CHECK(lazygrid_neighbors(detector, &query, &offsets, &indices) == LAZYGRID_OK);
    CHECK(offsets[0] == 0 && offsets[1] == 1 && offsets[2] == 3 && offsets[COUNT] == 2 * (COUNT - 1));
    CHECK(indices[0] == 1 && indices[1] == 0 && indices[2] == 2);
    lazygrid_destroy(detector);
    free(rows);
}

typedef struct {
    lazygrid_detector *detector, *other;
    uint64_t pairs, calls, largest;
    uint64_t until;
    int is_refused;
} taker;

static int32_t take(void *context, const lazygrid_pair *pairs, size_t count) {
    taker *own = context;
    lazygrid_spheres none = lazygrid_rows(0, NULL);
    lazygrid_query query = lazygrid_among(&none);
    uint64_t found;
    own->calls++;
    own->pairs += count;
    if (count > own->largest) own->largest = count;
    if (count > 0 && pairs[0].i >= pairs[0].j) own->pairs = 1000000;
    own->is_refused = lazygrid_count(own->detector, &query, &found) == LAZYGRID_ERROR_BUSY
                      && lazygrid_count(own->other, &query, &found) == LAZYGRID_ERROR_BUSY
                      && lazygrid_destroy(own->detector) == LAZYGRID_ERROR_BUSY
                      && lazygrid_last_error(own->detector)[0] != '\0';
    return own->pairs >= own->until;
}

static void streams_come_in_chunks_and_can_be_ended(void) {
    enum { COUNT = 20000, CHUNK = 100 };
    float *rows = line(COUNT);
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    int32_t order;
    for (order = LAZYGRID_ORDER_CANONICAL; order <= LAZYGRID_ORDER_UNORDERED; order++) {
        lazygrid_settings settings = on_cpu();
        lazygrid_detector *detector, *other = detector_of(&settings);
        taker all = {NULL, NULL, 0, 0, 0, UINT64_MAX, 0}, some = {NULL, NULL, 0, 0, 0, 250, 0};
        uint64_t delivered;
        settings.order = order;
        settings.threads = 2;
        detector = detector_of(&settings);
        all.detector = some.detector = detector;
        all.other = some.other = other;
        CHECK(lazygrid_stream(detector, &query, CHUNK, take, &all, &delivered) == LAZYGRID_OK);
        CHECK(delivered == COUNT - 1 && all.pairs == COUNT - 1 && all.largest <= CHUNK && all.is_refused);
        CHECK(lazygrid_stream(detector, &query, CHUNK, take, &some, &delivered) == LAZYGRID_OK);
        CHECK(delivered == some.pairs && delivered >= 250 && delivered < COUNT - 1);
        CHECK(lazygrid_stream(detector, &query, 0, take, &all, &delivered) == LAZYGRID_ERROR_ARGUMENT);
        CHECK(lazygrid_stream(detector, &query, CHUNK, NULL, NULL, &delivered) == LAZYGRID_ERROR_ARGUMENT);
        CHECK(lazygrid_count(other, &query, &delivered) == LAZYGRID_OK && delivered == COUNT - 1);
        CHECK(lazygrid_destroy(other) == LAZYGRID_OK);
        CHECK(lazygrid_destroy(detector) == LAZYGRID_OK);
    }
    free(rows);
}

static void species_decide(void) {
    static const float points[] = {0, 0, 0, 0, 0.1f, 0, 0, 0, 0.15f, 0, 0, 0};
    static const uint32_t species[] = {0, 1, 1}, beyond[] = {0, 1, 2};
    lazygrid_spheres spheres = lazygrid_rows(3, points);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_interactions *table;
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    uint64_t count;
    CHECK(lazygrid_interactions_create(2, LAZYGRID_NEVER, 0, &table) == LAZYGRID_OK);
    CHECK(lazygrid_interactions_set(table, 0, 1, LAZYGRID_WITHIN, 0.12) == LAZYGRID_OK);
    CHECK(lazygrid_interactions_set(table, 0, 2, LAZYGRID_TOUCH, 0) == LAZYGRID_ERROR_INPUT);
    CHECK(says(lazygrid_last_error(NULL), "species id 2"));
    CHECK(lazygrid_interactions_set(table, 0, 1, LAZYGRID_WITHIN, NAN) == LAZYGRID_ERROR_INPUT);
    CHECK(lazygrid_interactions_set(table, 0, 1, 3, 0) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_interactions_set(NULL, 0, 1, LAZYGRID_TOUCH, 0) == LAZYGRID_ERROR_ARGUMENT);
    settings.interactions = table;
    detector = detector_of(&settings);
    lazygrid_interactions_destroy(table);
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_INPUT);
    CHECK(says(lazygrid_last_error(detector), "no species ids"));
    spheres.species = species;
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == 1);
    spheres.species = beyond;
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_ERROR_INPUT && count == 0);
    lazygrid_destroy(detector);
    CHECK(lazygrid_interactions_create(5000, LAZYGRID_NEVER, 0, &table) == LAZYGRID_ERROR_INPUT && table == NULL);
    lazygrid_interactions_destroy(NULL);
}

static void boxes_are_periodic(void) {
    static const float rows[] = {0.2f, 5, 0, 0.5f, 9.6f, 5, 0, 0.5f};
    lazygrid_spheres spheres = lazygrid_rows(2, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    uint64_t count;
    settings.periodic[0] = settings.periodic[1] = 10;
    detector = detector_of(&settings);
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == 1);
    lazygrid_destroy(detector);
    settings.periodic[2] = -1;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_INPUT && detector == NULL);
    CHECK(says(lazygrid_last_error(NULL), "periodic axis z"));
}

static void every_algorithm_finds_the_same(void) {
    enum { COUNT = 500 };
    float *rows = line(COUNT);
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    int32_t algorithm;
    for (algorithm = LAZYGRID_ALGORITHM_AUTO; algorithm <= LAZYGRID_ALGORITHM_LAZY_GRID; algorithm++) {
        lazygrid_settings settings = on_cpu();
        lazygrid_detector *detector;
        lazygrid_status status;
        uint64_t count;
        settings.algorithm = algorithm;
        settings.threads = 1;
        status = lazygrid_create(&settings, &detector);
        if (algorithm >= LAZYGRID_ALGORITHM_EAGER_GRID) {
            CHECK(status == LAZYGRID_ERROR_SETTING && detector == NULL);
            CHECK(says(lazygrid_last_error(NULL), "does not run on the cpu backend"));
        } else {
            CHECK(status == LAZYGRID_OK);
            CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == COUNT - 1);
            lazygrid_destroy(detector);
        }
    }
    free(rows);
}

static void settings_without_effect_are_refused(void) {
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    settings.timeout_seconds = 10;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_SETTING && detector == NULL);
    CHECK(says(lazygrid_last_error(NULL), "a timeout of 10 seconds limits searches on a GPU"));
    settings = on_cpu();
    settings.skin = LAZYGRID_SKIN_FIXED;
    settings.skin_distance = 0.5;
    settings.algorithm = LAZYGRID_ALGORITHM_NAIVE;
    CHECK(lazygrid_create(&settings, &detector) == LAZYGRID_ERROR_SETTING && detector == NULL);
    CHECK(says(lazygrid_last_error(NULL), "cell-list"));
}

static void too_many_pairs_come_with_their_number(void) {
    enum { COUNT = 1000 };
    float *rows = line(COUNT);
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector;
    const lazygrid_pair *pairs;
    const uint64_t *offsets;
    const uint32_t *indices;
    lazygrid_list list;
    uint64_t count;
    settings.max_pairs = 10;
    detector = detector_of(&settings);
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_ERROR_TOO_MANY_PAIRS);
    CHECK(pairs == NULL && count == COUNT - 1);
    CHECK(says(lazygrid_last_error(detector), "999"));
    CHECK(lazygrid_neighbors(detector, &query, &offsets, &indices) == LAZYGRID_ERROR_TOO_MANY_PAIRS);
    CHECK(indices == NULL && offsets != NULL && *offsets == COUNT - 1);
    CHECK(lazygrid_neighbor_list(detector, &query, 0, &list) == LAZYGRID_ERROR_TOO_MANY_PAIRS);
    CHECK(list.pairs == NULL && list.length == COUNT - 1);
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK && count == COUNT - 1);
    CHECK(strcmp(lazygrid_last_error(detector), "") == 0);
    lazygrid_destroy(detector);
    free(rows);
}

static void bad_spheres_are_named(void) {
    static const float rows[] = {0, 0, 0, 1, 0, NAN, 0, 1, 0, 0, 0, -1};
    lazygrid_spheres spheres = lazygrid_rows(3, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    const lazygrid_pair *pairs = (const lazygrid_pair *)rows;
    uint64_t count = 7;
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_ERROR_INPUT);
    CHECK(pairs == NULL && count == 0);
    CHECK(says(lazygrid_last_error(detector), "sphere 1 has center (0, NaN, 0)"));
    CHECK(says(lazygrid_last_error(detector), "2 of 3"));
    spheres.count = (size_t)-1;
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_ERROR_INPUT);
    lazygrid_destroy(detector);
}

static void misuse_is_a_status(void) {
    static const float rows[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    lazygrid_spheres spheres = lazygrid_rows(2, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    const lazygrid_pair *pairs;
    uint64_t count;
    CHECK(lazygrid_pairs(NULL, &query, &pairs, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(NULL), "`detector` is NULL"));
    CHECK(lazygrid_pairs(detector, NULL, &pairs, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(detector), "`query` is NULL"));
    CHECK(lazygrid_pairs(detector, &query, NULL, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_pairs(detector, &query, &pairs, NULL) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_report_json(detector, NULL) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_create(&settings, NULL) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_destroy(NULL) == LAZYGRID_OK);
    spheres.x = (const char *)rows + 1;
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(detector), "a multiple of 4"));
    spheres = lazygrid_columns(2, rows, rows, NULL, rows);
    CHECK(lazygrid_pairs(detector, &query, &pairs, &count) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(detector), "`z` is NULL"));
    lazygrid_destroy(detector);
}

static void settings_may_be_older_or_newer(void) {
    struct {
        lazygrid_settings known;
        uint64_t newer;
    } settings;
    lazygrid_detector *detector;
    CHECK(lazygrid_settings_init(&settings.known, sizeof settings) == LAZYGRID_OK);
    settings.known.backend = LAZYGRID_BACKEND_CPU;
    CHECK(lazygrid_create(&settings.known, &detector) == LAZYGRID_OK);
    lazygrid_destroy(detector);
    settings.newer = 1;
    CHECK(lazygrid_create(&settings.known, &detector) == LAZYGRID_ERROR_ARGUMENT);
    settings.known.size = 8;
    CHECK(lazygrid_create(&settings.known, &detector) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_settings_init(&settings.known, 8) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(lazygrid_settings_init(NULL, sizeof settings) == LAZYGRID_ERROR_ARGUMENT);
    settings.known = on_cpu();
    settings.known.algorithm = 99;
    CHECK(lazygrid_create(&settings.known, &detector) == LAZYGRID_ERROR_ARGUMENT);
    CHECK(says(lazygrid_last_error(NULL), "settings.algorithm is 99"));
    settings.known = on_cpu();
    settings.known.adapter = "none such";
    CHECK(lazygrid_create(&settings.known, &detector) != LAZYGRID_OK && detector == NULL);
}

static void reports_and_names(void) {
    enum { COUNT = 2000 };
    float *rows = line(COUNT);
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_settings settings = on_cpu();
    lazygrid_detector *detector = detector_of(&settings);
    const char *json;
    uint64_t count, bytes, more;
    CHECK(lazygrid_count(detector, &query, &count) == LAZYGRID_OK);
    CHECK(lazygrid_report_json(detector, &json) == LAZYGRID_OK);
    CHECK(says(json, "\"spheres\":2000,\"pairs\":1999,\"backend\":\"cpu\",\"adapter\":null"));
    CHECK(says(json, "\"candidates\":null"));
    CHECK(says(json, "\"phases\":{\""));
    CHECK(lazygrid_memory_for(detector, 1000, &bytes) == LAZYGRID_OK && bytes > 0);
    CHECK(lazygrid_memory_for(detector, 1000000, &more) == LAZYGRID_OK && more > bytes);
    CHECK(lazygrid_memory_for(detector, UINT32_MAX - 1, &bytes) == LAZYGRID_OK);
    CHECK(lazygrid_memory_for(detector, UINT64_MAX, &more) == LAZYGRID_OK && more == bytes);
    CHECK(strcmp(lazygrid_status_name(LAZYGRID_ERROR_BUSY), "LAZYGRID_ERROR_BUSY") == 0);
    CHECK(strcmp(lazygrid_status_name(-1), "unknown status") == 0);
    CHECK(lazygrid_version()[0] - '0' == LAZYGRID_VERSION_MAJOR);
    lazygrid_destroy(detector);
    free(rows);
}

int main(void) {
    rows_and_columns_give_the_same();
    none_and_one_are_ordinary();
    neighbors_are_in_both_lists();
    streams_come_in_chunks_and_can_be_ended();
    species_decide();
    boxes_are_periodic();
    every_algorithm_finds_the_same();
    settings_without_effect_are_refused();
    too_many_pairs_come_with_their_number();
    bad_spheres_are_named();
    misuse_is_a_status();
    settings_may_be_older_or_newer();
    reports_and_names();
    printf("%d passed, %d failed\n", passed, failed);
    return failed != 0;
}
