/*
 * Under any limit of the address space, calls return a status and never end the process. Each limit has a process of its
 * own, in which the same calls succeed once the limit is lifted.
 */
#define _POSIX_C_SOURCE 200809L
#include "checks.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum { COUNT = 200000, SPECIES = 4096, LIMITS = 16, REFUSED = 2 };

static float rows[4 * COUNT];
static uint32_t species[COUNT];
static uint64_t offsets[COUNT + 1];
static uint32_t indices[COUNT];
static int refused;

/* Every second pair is excluded. */
static void fill(void) {
    size_t k;
    for (k = 0; k < COUNT; k++) {
        rows[4 * k] = 0.5f * (float)k;
        rows[4 * k + 3] = 0.3f;
        species[k] = (uint32_t)k % SPECIES;
        indices[k] = (uint32_t)(k + 1) % COUNT;
        offsets[k + 1] = offsets[k] + (k % 2 == 0);
        if (k % 2 == 0) indices[offsets[k]] = (uint32_t)k + 1;
    }
}

static int32_t take(void *context, const lazygrid_pair *pairs, size_t count) {
    (void)pairs;
    *(uint64_t *)context += count;
    return 0;
}

/* True if the call succeeded. */
static int done(lazygrid_status status) {
    CHECK(status == LAZYGRID_OK || status == LAZYGRID_ERROR_OUT_OF_MEMORY || status == LAZYGRID_ERROR_THREADS);
    if (status != LAZYGRID_OK) refused++;
    return status == LAZYGRID_OK;
}

static void search(lazygrid_detector *detector, const lazygrid_query *query) {
    const uint64_t expected = COUNT / 2 - 1;
    const lazygrid_pair *pairs;
    const uint64_t *starts;
    const uint32_t *neighbors;
    lazygrid_list list;
    uint64_t count, taken = 0;
    if (done(lazygrid_pairs(detector, query, &pairs, &count))) CHECK(count == expected && pairs[0].i == 1);
    if (done(lazygrid_stream(detector, query, 1000, take, &taken, &count))) CHECK(taken == expected);
    if (done(lazygrid_neighbors(detector, query, &starts, &neighbors))) CHECK(starts[COUNT] == 2 * expected);
    if (done(lazygrid_neighbor_list(detector, query, LAZYGRID_LIST_DISTANCES, &list))) CHECK(list.length > 0);
}

static void all_calls(void) {
    lazygrid_settings settings = on_cpu();
    lazygrid_spheres spheres = lazygrid_rows(COUNT, rows);
    lazygrid_query query = lazygrid_among(&spheres);
    lazygrid_interactions *table = NULL;
    lazygrid_exclusions *exclusions = NULL;
    lazygrid_detector *detector = NULL;
    spheres.species = species;
    settings.threads = 2;
    if (done(lazygrid_interactions_create(SPECIES, LAZYGRID_TOUCH, 0, &table))) settings.interactions = table;
    if (done(lazygrid_exclusions_from_csr(COUNT, offsets, indices, &exclusions))) query.exclusions = exclusions;
    if (done(lazygrid_create(&settings, &detector)) && exclusions != NULL) search(detector, &query);
    lazygrid_destroy(detector);
    lazygrid_exclusions_destroy(exclusions);
    lazygrid_interactions_destroy(table);
}

static rlim_t mapped(void) {
    unsigned long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    CHECK(file != NULL && fscanf(file, "%lu", &pages) == 1);
    if (file != NULL) fclose(file);
    return (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE);
}

/* Returns the exit code of a process that may map `more` bytes, or -1 if a signal ended it. */
static int under(size_t more) {
    int status = 0;
    const pid_t child = fork();
    if (child == 0) {
        struct rlimit before, limit;
        getrlimit(RLIMIT_AS, &before);
        limit = before;
        limit.rlim_cur = mapped() + more;
        setrlimit(RLIMIT_AS, &limit);
        all_calls();
        setrlimit(RLIMIT_AS, &before);
        limit.rlim_cur = (rlim_t)refused;
        all_calls();
        CHECK((rlim_t)refused == limit.rlim_cur);
        _exit(failed > 0 ? 1 : refused > 0 ? REFUSED : 0);
    }
    CHECK(child > 0 && waitpid(child, &status, 0) == child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

int main(void) {
    double more = 1 << 20;
    int k, code = 0;
    fill();
    for (k = 0; k < LIMITS; k++, more *= 1.6) {
        code = under((size_t)more);
        CHECK(code == 0 || code == REFUSED);
        if (k == 0) CHECK(code == REFUSED);
        if (code != 0 && code != REFUSED) fprintf(stderr, "limit %.0f bytes: exit code %d\n", more, code);
    }
    CHECK(code == 0);
    printf("%d passed, %d failed\n", passed, failed);
    return failed > 0;
}
