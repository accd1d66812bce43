/*
 * lazygrid: all pairs of overlapping spheres, at every step of a simulation.
 *
 *     lazygrid_detector *detector;
 *     if (lazygrid_create(NULL, &detector) != LAZYGRID_OK) { puts(lazygrid_last_error(NULL)); exit(1); }
 *     for (step = 0; step < steps; step++) {
 *         lazygrid_spheres spheres = lazygrid_rows(n, rows);     x, y, z, r of each sphere
 *         lazygrid_query query = lazygrid_among(&spheres);
 *         const lazygrid_pair *pairs;
 *         uint64_t count;
 *         if (lazygrid_pairs(detector, &query, &pairs, &count) != LAZYGRID_OK) { ... }
 *         for (k = 0; k < count; k++) collide(pairs[k].i, pairs[k].j);
 *     }
 *     lazygrid_destroy(detector);
 *
 * WHAT A PAIR IS. (i, j) with i < j and (xi-xj)^2 + (yi-yj)^2 + (zi-zj)^2 <= (ri+rj)^2. Touching counts, coincident
 * centers count, each pair once. Numbers are floats or doubles, and none is rounded: of doubles the expression is evaluated
 * in double precision. Space is unbounded unless it is said to be periodic. Lengths are in one unit, the caller's. Radius 0
 * is a point. Zero and one sphere are ordinary inputs. Spheres of one group, and excluded pairs, are never reported.
 *
 * A QUERY is a set of spheres, whose pairs are asked for, or two sets, of which each pair has one sphere of each; and pairs
 * that are excluded. All searches take one: lazygrid_pairs, lazygrid_count, lazygrid_neighbors, lazygrid_neighbor_list and
 * lazygrid_stream.
 * Two sets work with every algorithm.
 *
 * ERRORS. Functions that can fail return a lazygrid_status, LAZYGRID_OK being 0. lazygrid_last_error tells in words
 * what was wrong, with the value, the limit and the remedy. Nothing is truncated, nothing unwinds into the caller,
 * nothing is printed unless a fault of the library itself makes Rust report a panic on standard error; the call then
 * returns LAZYGRID_ERROR_INTERNAL. Where a function fails, the results it was to write are NULL and 0, unless it
 * says otherwise.
 *
 * LIFETIMES. Inputs are read during the call and never kept; they must not change meanwhile. The arrays that a search
 * hands out belong to the detector and live until the next search with it, even if that search fails, or until the
 * detector is destroyed. They must not be written to, nor given to the same detector as an input.
 *
 * THREADS. Any thread may call with any detector, one at a time. A detector that is used by two threads at once, or
 * from its own callback, answers LAZYGRID_ERROR_BUSY to the second and is not harmed. Different detectors are
 * independent. Searches use the threads of one pool that the process shares, unless `threads` is set. A process that
 * forks must not use the library in the child if the parent has used it.
 *
 * GROWTH. lazygrid_settings, lazygrid_spheres and lazygrid_query begin with their own size; later versions append fields,
 * and 0 always means the default, so that programs compiled with an older header go on working. All bytes of such a
 * structure, up to its size, must be initialized. The other structures do not change within versions that share a SONAME.
 */
#ifndef LAZYGRID_H
#define LAZYGRID_H

#include <stddef.h>
#include <stdint.h>

/* The version of this header; lazygrid_version is that of the library. */
#define LAZYGRID_VERSION_MAJOR 0
#define LAZYGRID_VERSION_MINOR 1
#define LAZYGRID_VERSION_PATCH 0

/* Programs that link the static library on Windows define LAZYGRID_STATIC. */
#if defined(_WIN32) && !defined(LAZYGRID_STATIC)
#define LAZYGRID_API __declspec(dllimport)
#else
#define LAZYGRID_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* What became of a call. */
typedef int32_t lazygrid_status;
enum {
    LAZYGRID_OK = 0,
    /* A pointer is NULL or not aligned, a size or a step is wrong, or a number is none of those listed here. */
    LAZYGRID_ERROR_ARGUMENT = 1,
    /* An input is refused: NaN, infinity, a negative radius, a species that the table does not have, too many spheres,
       a periodic length, an edge or a distance that is none, excluded pairs of other spheres. The message names the first
       sphere and its value. */
    LAZYGRID_ERROR_INPUT = 2,
    /* A setting is out of range, or two do not go together. */
    LAZYGRID_ERROR_SETTING = 3,
    /* A list would hold more than `max_pairs` pairs. */
    LAZYGRID_ERROR_TOO_MANY_PAIRS = 4,
    /* The system or the GPU refused memory. */
    LAZYGRID_ERROR_OUT_OF_MEMORY = 5,
    /* The system refused threads. */
    LAZYGRID_ERROR_THREADS = 6,
    /* A GPU was asked for and cannot be used. */
    LAZYGRID_ERROR_GPU_UNAVAILABLE = 7,
    /* Something does not fit the GPU. */
    LAZYGRID_ERROR_DEVICE_LIMIT = 8,
    /* The GPU was lost or refused a call; make another detector. */
    LAZYGRID_ERROR_DEVICE_LOST = 9,
    /* The GPU did not finish in time. */
    LAZYGRID_ERROR_TIMEOUT = 10,
    /* The detector is in use by another thread, or this is the callback of a search. It has no message. */
    LAZYGRID_ERROR_BUSY = 11,
    /* A fault of the library. The detector is of no further use; destroy it. */
    LAZYGRID_ERROR_INTERNAL = 12
};

/* Where to search. AUTO takes a real GPU if there is one and a call has enough spheres, else the CPU. */
enum { LAZYGRID_BACKEND_AUTO = 0, LAZYGRID_BACKEND_CPU = 1, LAZYGRID_BACKEND_GPU = 2 };

/* How to search. All find the same pairs; AUTO chooses at each call and is right for almost all programs. */
enum {
    LAZYGRID_ALGORITHM_AUTO = 0,
    LAZYGRID_ALGORITHM_NAIVE = 1,          /* all with all; CPU and GPU */
    LAZYGRID_ALGORITHM_HASH_GRID = 2,      /* CPU */
    LAZYGRID_ALGORITHM_ARRAY_GRID = 3,     /* CPU and GPU */
    LAZYGRID_ALGORITHM_RECURSIVE_GRID = 4, /* CPU */
    LAZYGRID_ALGORITHM_CELL_LIST = 5,      /* CPU and GPU */
    LAZYGRID_ALGORITHM_EAGER_GRID = 6,     /* GPU */
    LAZYGRID_ALGORITHM_LAZY_GRID = 7       /* GPU */
};

/* In which order pairs come: CANONICAL is by i, then j. UNORDERED saves the sorting. */
enum { LAZYGRID_ORDER_CANONICAL = 0, LAZYGRID_ORDER_UNORDERED = 1 };

/*
 * Whether a detector keeps candidates, pairs that may soon overlap, from call to call. An answer never depends on it.
 * AUTO keeps them where spheres move so little that it is expected to take less time, by the spheres alone and never by a
 * clock. OFF searches anew at every call. FIXED keeps the pairs that are up to `skin_distance` too far apart to touch, until
 * some sphere has moved by half of it; on the CPU only with LAZYGRID_ALGORITHM_AUTO and _CELL_LIST.
 */
enum { LAZYGRID_SKIN_AUTO = 0, LAZYGRID_SKIN_OFF = 1, LAZYGRID_SKIN_FIXED = 2 };

/* What makes two spheres of given species a pair. */
enum {
    LAZYGRID_NEVER = 0,
    LAZYGRID_TOUCH = 1, /* centres at most ri + rj apart */
    LAZYGRID_WITHIN = 2 /* centres at most a given distance apart, whatever the radii */
};

/* Finds pairs, call after call, reusing its memory. */
typedef struct lazygrid_detector lazygrid_detector;

/* A table: for any two species, what makes them a pair. */
typedef struct lazygrid_interactions lazygrid_interactions;

/* Pairs that are never reported, such as bonds. */
typedef struct lazygrid_exclusions lazygrid_exclusions;

/* The group of spheres that are in none. */
#define LAZYGRID_NO_GROUP 4294967295u

/*
 * Two overlapping spheres by their indices in the input, from 0 on; i < j. Between two sets `i` is an index in the
 * first and `j` one in the second, and either may be the larger.
 */
typedef struct lazygrid_pair {
    uint32_t i;
    uint32_t j;
} lazygrid_pair;

/* What a detector is asked to do. A zero is the default of its field. Set `size` by lazygrid_settings_init. */
typedef struct lazygrid_settings {
    size_t size;              /* sizeof(lazygrid_settings) */
    int32_t backend;          /* LAZYGRID_BACKEND_... */
    int32_t algorithm;        /* LAZYGRID_ALGORITHM_... */
    int32_t order;            /* LAZYGRID_ORDER_... */
    uint32_t threads;         /* on the CPU; 0: as many as the process may use, shared by all detectors */
    uint64_t max_pairs;       /* the most a list may hold, 8 bytes each; 0: 2^29. Counts and streams have no limit */
    double periodic[3];       /* the length of each periodic axis x, y, z; 0: unbounded */
    uint32_t timeout_seconds; /* how long a call may take a GPU; 0: ten minutes */
    int32_t skin;             /* LAZYGRID_SKIN_... */
    double skin_distance;     /* for LAZYGRID_SKIN_FIXED, 1e-14 to 1e17, in the unit of the spheres; else 0 */
    const char *adapter;      /* a GPU by its number, or by a part of its name that no other has, in UTF-8; or NULL */
    const lazygrid_interactions *interactions; /* copied when the detector is made; NULL: all that touch are pairs */
    const double *cell_vectors;      /* 9 doubles: three cell vectors x, y, z along which space repeats, as those of a
                                 triclinic cell; 0, 0, 0: one along which it does not. Read when the detector is made.
                                 NULL: see `periodic`, which must else be 0 */
} lazygrid_settings;

/* The type of the numbers of spheres. */
enum {
    LAZYGRID_F32 = 0, /* float */
    LAZYGRID_F64 = 1  /* double */
};

/*
 * A set of spheres, read where it lies: rows, columns, points with one radius, arrays of structures, `x[0]` of a `double **`.
 * Make it by lazygrid_rows or its like below, then set `species` and `groups` if needed.
 *
 * Number k of x is the one at `x` plus k * `step` bytes; so are y and z, and r with `r_step`. Both steps are multiples of
 * the size of a number. `step` is not 0 if there are two spheres or more; `r_step` 0 gives all spheres the radius at `r`.
 * Pointers are aligned as numbers are. From the first to the last number that it leads to, the memory at each pointer is
 * part of one array and does not change during a call, gaps included; these may hold anything. With count 0 no pointer is
 * read, and all may be NULL.
 *
 * `species` has `count` ids below the number of species of the table, if the detector has one; else it may be NULL.
 * `groups` has `count` numbers, or is NULL: two spheres of one group, such as a molecule or a rigid body, are never a pair,
 * except those of LAZYGRID_NO_GROUP. Two spheres of two sets are of one group if their numbers are equal.
 */
typedef struct lazygrid_spheres {
    size_t size;   /* sizeof(lazygrid_spheres) */
    size_t count;  /* the number of spheres */
    const void *x; /* the coordinates of the first center */
    const void *y;
    const void *z;
    const void *r; /* the first radius, or the only one */
    size_t step;   /* bytes from one center to the next */
    size_t r_step; /* bytes from one radius to the next; 0: one radius for all */
    int32_t type;  /* LAZYGRID_F32 or LAZYGRID_F64, of all numbers */
    int32_t zero;  /* 0 */
    const uint32_t *species;
    const uint32_t *groups;
} lazygrid_spheres;

/* A question to a detector. Make it by lazygrid_among or lazygrid_across, then set `exclusions` if needed. */
typedef struct lazygrid_query {
    size_t size;                    /* sizeof(lazygrid_query) */
    const lazygrid_spheres *first;  /* the only set, or the first of two */
    const lazygrid_spheres *second; /* the second set; NULL: the pairs among `first` */
    const lazygrid_exclusions *exclusions; /* made for these numbers of spheres, or NULL. What is excluded is neither
                                              counted nor given room. It may change from call to call */
} lazygrid_query;

/* `count` spheres in memory of any layout: see lazygrid_spheres. */
static inline lazygrid_spheres lazygrid_strided(int32_t type, size_t count, const void *x, const void *y, const void *z,
                                                size_t step, const void *r, size_t r_step) {
    lazygrid_spheres spheres = {sizeof(lazygrid_spheres), count, x, y, z, r, step, r_step, type, 0, NULL, NULL};
    return spheres;
}

/* `count` spheres as rows: 4 * `count` floats x, y, z, r, x, y, ... */
static inline lazygrid_spheres lazygrid_rows(size_t count, const float *rows) {
    const size_t step = 4 * sizeof(float);
    if (rows == NULL) return lazygrid_strided(LAZYGRID_F32, count, NULL, NULL, NULL, step, NULL, step);
    return lazygrid_strided(LAZYGRID_F32, count, rows, rows + 1, rows + 2, step, rows + 3, step);
}

/* The same of doubles. */
static inline lazygrid_spheres lazygrid_rows_f64(size_t count, const double *rows) {
    const size_t step = 4 * sizeof(double);
    if (rows == NULL) return lazygrid_strided(LAZYGRID_F64, count, NULL, NULL, NULL, step, NULL, step);
    return lazygrid_strided(LAZYGRID_F64, count, rows, rows + 1, rows + 2, step, rows + 3, step);
}

/* `count` spheres as four columns of `count` floats each. */
static inline lazygrid_spheres lazygrid_columns(size_t count, const float *x, const float *y, const float *z,
                                                const float *r) {
    return lazygrid_strided(LAZYGRID_F32, count, x, y, z, sizeof(float), r, sizeof(float));
}

/* The same of doubles. */
static inline lazygrid_spheres lazygrid_columns_f64(size_t count, const double *x, const double *y, const double *z,
                                                    const double *r) {
    return lazygrid_strided(LAZYGRID_F64, count, x, y, z, sizeof(double), r, sizeof(double));
}

/*
 * `count` points, 3 * `count` floats x, y, z, x, y, ..., all of the radius at `radius`, which lives as long as the spheres
 * are used. Half a cutoff makes pairs of points that are within the cutoff.
 */
static inline lazygrid_spheres lazygrid_points(size_t count, const float *centers, const float *radius) {
    const size_t step = 3 * sizeof(float);
    if (centers == NULL) return lazygrid_strided(LAZYGRID_F32, count, NULL, NULL, NULL, step, radius, 0);
    return lazygrid_strided(LAZYGRID_F32, count, centers, centers + 1, centers + 2, step, radius, 0);
}

/* The same of doubles. */
static inline lazygrid_spheres lazygrid_points_f64(size_t count, const double *centers, const double *radius) {
    const size_t step = 3 * sizeof(double);
    if (centers == NULL) return lazygrid_strided(LAZYGRID_F64, count, NULL, NULL, NULL, step, radius, 0);
    return lazygrid_strided(LAZYGRID_F64, count, centers, centers + 1, centers + 2, step, radius, 0);
}

/* A query for the pairs among `spheres`, which it points to. */
static inline lazygrid_query lazygrid_among(const lazygrid_spheres *spheres) {
    lazygrid_query query = {sizeof(lazygrid_query), spheres, NULL, NULL};
    return query;
}

/*
 * A query for the pairs of one sphere of `first` and one of `second`, which it points to: particles and receivers, say, or
 * the spheres of a process and ghosts. If the detector has a table, both sets need species. Both may be the same spheres;
 * each is then a pair with itself. A message about `second` begins with "of the second set, ".
 */
static inline lazygrid_query lazygrid_across(const lazygrid_spheres *first, const lazygrid_spheres *second) {
    lazygrid_query query = {sizeof(lazygrid_query), first, second, NULL};
    return query;
}

/*
 * Takes up to `count` pairs of a stream. Returns 0 to go on; any other value ends the search. The pairs live until it
 * returns. It may be called from a thread other than the one that called lazygrid_stream, never twice at a time. It
 * must return: no exception and no longjmp may leave it. It must not search, with any detector, for it may hold
 * up the threads that such a search would need: that is LAZYGRID_ERROR_BUSY in the same thread, and must not be done by
 * waiting for another one.
 */
typedef int32_t (*lazygrid_pair_callback)(void *context, const lazygrid_pair *pairs, size_t count);

/* The version of the library, as "0.1.0". */
LAZYGRID_API const char *lazygrid_version(void);

/* The name of a status, as "LAZYGRID_OK"; "unknown status" for any other number. */
LAZYGRID_API const char *lazygrid_status_name(lazygrid_status status);

/*
 * In words why the last call with `detector` failed; "" if it did not. With NULL: the same of the last call in this
 * thread that had no detector (lazygrid_create, lazygrid_settings_init, what makes or sets interactions and exclusions,
 * and any call that was given NULL for one). UTF-8. It lives until the next call with that detector, or the next such call in
 * this thread, other than of this function.
 */
LAZYGRID_API const char *lazygrid_last_error(const lazygrid_detector *detector);

/* Sets all fields to their defaults, and `size`. Write lazygrid_settings_init(&settings, sizeof settings). */
LAZYGRID_API lazygrid_status lazygrid_settings_init(lazygrid_settings *settings, size_t size);

/*
 * A table for species 0 to `species` - 1, at most 4096, in which every two species have the interaction `kind`
 * (LAZYGRID_NEVER, _TOUCH or _WITHIN). `distance` counts for LAZYGRID_WITHIN only. Used by one thread at a time.
 */
LAZYGRID_API lazygrid_status lazygrid_interactions_create(uint32_t species, int32_t kind, double distance,
                                                          lazygrid_interactions **interactions);

/* Sets the interaction of species `a` with `b`, and of `b` with `a`. Where it fails, the table is as it was. */
LAZYGRID_API lazygrid_status lazygrid_interactions_set(lazygrid_interactions *interactions, uint32_t a, uint32_t b,
                                                       int32_t kind, double distance);

/* Frees a table. Detectors made with it keep their copies. NULL is left alone. */
LAZYGRID_API void lazygrid_interactions_destroy(lazygrid_interactions *interactions);

/*
 * A list of `count` pairs among so many spheres, in either order, or both, and more than once. It never changes, so that
 * any threads may use it at once, and it must live as long as queries name it. It serves all calls with as many spheres;
 * when spheres come or go, make another. A sphere with itself is no pair, and may be named.
 */
LAZYGRID_API lazygrid_status lazygrid_exclusions_create(size_t spheres, const lazygrid_pair *pairs, size_t count,
                                                        lazygrid_exclusions **exclusions);

/* The same for searches between two sets, of so many spheres each: `i` is an index in the first, `j` one in the second. */
LAZYGRID_API lazygrid_status lazygrid_exclusions_across(size_t first, size_t second, const lazygrid_pair *pairs,
                                                         size_t count, lazygrid_exclusions **exclusions);

/*
 * The pairs of compressed sparse rows, laid out as by lazygrid_neighbors, whose results it takes as they are: `offsets`
 * has one more than there are spheres, and its last is the length of `indices`. It is enough that one of two spheres
 * names the other; rows need no order.
 */
LAZYGRID_API lazygrid_status lazygrid_exclusions_from_csr(size_t spheres, const uint64_t *offsets, const uint32_t *indices,
                                                         lazygrid_exclusions **exclusions);

/* Frees a list. NULL is left alone. */
LAZYGRID_API void lazygrid_exclusions_destroy(lazygrid_exclusions *exclusions);

/* Makes a detector; `settings` may be NULL for the defaults. The backend is decided here. */
LAZYGRID_API lazygrid_status lazygrid_create(const lazygrid_settings *settings, lazygrid_detector **detector);

/*
 * Frees a detector and all that it delivered out. NULL is left alone. While a search runs it is LAZYGRID_ERROR_BUSY and
 * nothing is freed; that is noticed, but another thread must not begin a search at the same moment.
 */
LAZYGRID_API lazygrid_status lazygrid_destroy(lazygrid_detector *detector);

/*
 * The overlapping pairs, `count` of them at `*pairs`. With LAZYGRID_ERROR_TOO_MANY_PAIRS `*count` is how many there
 * are, exactly.
 */
LAZYGRID_API lazygrid_status lazygrid_pairs(lazygrid_detector *detector, const lazygrid_query *query,
                                            const lazygrid_pair **pairs, uint64_t *count);

/* The number of pairs. Needs no memory for them, so that any number can be counted. */
LAZYGRID_API lazygrid_status lazygrid_count(lazygrid_detector *detector, const lazygrid_query *query, uint64_t *count);

/*
 * The pairs as neighbor lists in compressed sparse rows: the neighbors of sphere k are `indices[offsets[k]]` to
 * `indices[offsets[k + 1] - 1]`, ascending. Of one set every pair is in both lists. Of two sets there is a list for each
 * sphere of the first one, with its neighbors in the second. `*offsets` has one more value than there are lists; the last
 * is the length of `*indices`.
 */
LAZYGRID_API lazygrid_status lazygrid_neighbors(lazygrid_detector *detector, const lazygrid_query *query,
                                                const uint64_t **offsets, const uint32_t **indices);

/*
 * Hands the pairs to `consume` in chunks of at most `chunk`, 1 or more, and says in `*delivered` how many it got. Memory
 * stays bounded for any number of pairs. In canonical order a result of more than `max_pairs` pairs takes a further
 * search per that many. `context` is passed on as it is.
 */
LAZYGRID_API lazygrid_status lazygrid_stream(lazygrid_detector *detector, const lazygrid_query *query, size_t chunk,
                                             lazygrid_pair_callback consume, void *context, uint64_t *delivered);

/* Options of lazygrid_neighbor_list, to be added up. */
enum {
    LAZYGRID_LIST_HALF = 1, /* every pair once, else twice: i < j, and of opposite images of a sphere one */
    LAZYGRID_LIST_OPEN = 2, /* only distances below the reach, as ASE has it; else touching counts */
    LAZYGRID_LIST_SELF = 4, /* every sphere of a radius above 0 is its own neighbor, too, at distance 0 */
    LAZYGRID_LIST_SHIFTS = 8,
    LAZYGRID_LIST_VECTORS = 16,
    LAZYGRID_LIST_DISTANCES = 32
};

/*
 * A neighbor list: `length` entries, of which those of sphere k are `offsets[k]` to `offsets[k + 1] - 1`. Arrays that were not
 * asked for are NULL.
 */
typedef struct lazygrid_list {
    uint64_t length;
    const uint64_t *offsets;
    const lazygrid_pair *pairs;  /* the sphere and its neighbor; in a full list i may be the larger index */
    const int32_t (*shifts)[3];  /* the number of each edge of the space that leads to the image of the neighbor */
    const double (*vectors)[3];  /* from the sphere to that image */
    const double *distances;
} lazygrid_list;

/*
 * The neighbor list of a query with all periodic images within reach, also in a box that is smaller than the reach, where a
 * sphere may be the neighbor of its own images. It is computed in double precision, in order of i, j and the shift. Excluded
 * pairs and spheres of one group are left out with all their images.
 */
LAZYGRID_API lazygrid_status lazygrid_neighbor_list(lazygrid_detector *detector, const lazygrid_query *query,
                                                    uint32_t options, lazygrid_list *list);

/*
 * What the last search did and why, as one JSON object: "spheres" and "pairs" (how many; of two sets the spheres of
 * both), "backend", "adapter" (null on the CPU), "algorithm", "reason", "gpu" (what it cost a GPU: "dispatches",
 * "working_bytes", "pair_bytes", "traffic_bytes"; null on the CPU), "candidates" (those that the search was answered from:
 * "count", "age" in calls, "displacement_fraction", the largest used fraction of the displacement limit, "rebuilt", why
 * they were found anew in this call or null; null where it searched without any), "phases" (seconds by name, in the
 * order of the work). Later versions may add names.
 * The text lives until the next lazygrid_report_json with that detector.
 */
LAZYGRID_API lazygrid_status lazygrid_report_json(lazygrid_detector *detector, const char **json);

/*
 * An estimate of the bytes that the detector holds for so many spheres, besides the result; on the CPU an upper one.
 * UINT64_MAX where a GPU cannot hold them.
 */
LAZYGRID_API lazygrid_status lazygrid_memory_for(lazygrid_detector *detector, uint64_t spheres, uint64_t *bytes);

#ifdef __cplusplus
}
#endif

#endif
