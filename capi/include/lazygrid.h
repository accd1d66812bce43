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
 * PAIRS. (i, j) with i < j and (xi-xj)^2 + (yi-yj)^2 + (zi-zj)^2 <= (ri+rj)^2. Touching and coincident spheres are
 * pairs, each once. Numbers are floats or doubles and are never rounded; for doubles the expression is evaluated in
 * double precision. Space is unbounded unless the settings make it periodic. All lengths have one unit, the caller's. A
 * sphere of radius 0 is a point. Searches omit pairs within a group and excluded pairs.
 *
 * A QUERY is one set of spheres, for the pairs among them, or two sets, for pairs of one sphere of each; and optional
 * exclusions.
 *
 * ERRORS. Functions that can fail return a lazygrid_status; LAZYGRID_OK is 0. lazygrid_last_error returns a message
 * with the value, the limit and the remedy. No result is truncated, and no exception unwinds into the caller. The
 * library prints only if a bug in it causes a panic, which Rust reports on standard error; the call then returns
 * LAZYGRID_ERROR_INTERNAL. A function that fails sets its results to NULL and 0, unless it says otherwise.
 *
 * LIFETIMES. Inputs are read during the call only and must not change meanwhile. Returned arrays belong to the detector
 * and live until its next search, even if that fails, or until it is destroyed. The caller must not write to them, nor
 * pass them to the same detector as an input.
 *
 * THREADS. Any thread may use any detector, one at a time. A second thread, or a detector's own callback, gets
 * LAZYGRID_ERROR_BUSY and does not disturb the first call. Searches use one thread pool of the process, unless
 * `threads` is set. A forked child must not use the library if the parent has used it.
 *
 * NEWER VERSIONS. lazygrid_settings, lazygrid_spheres and lazygrid_query begin with their own size. Later versions
 * append fields, of which 0 is the default, so programs compiled with an older header keep working. All bytes of such a
 * structure, up to its size, must be initialized. Other structures do not change while the SONAME is the same.
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

/* Status codes. */
typedef int32_t lazygrid_status;
enum {
    LAZYGRID_OK = 0,
    /* A NULL or misaligned pointer, a wrong size or step, or an unknown constant. */
    LAZYGRID_ERROR_ARGUMENT = 1,
    /* Invalid input: NaN, infinity, a negative radius, an unknown species, too many spheres, an invalid periodic
       length, cell vector or distance, or exclusions of another number of spheres. The message names the first
       sphere and its value. */
    LAZYGRID_ERROR_INPUT = 2,
    /* A setting is out of range, or two settings contradict each other. */
    LAZYGRID_ERROR_SETTING = 3,
    /* A list would have more than `max_pairs` pairs. */
    LAZYGRID_ERROR_TOO_MANY_PAIRS = 4,
    /* The system or the GPU is out of memory. */
    LAZYGRID_ERROR_OUT_OF_MEMORY = 5,
    /* The system cannot start threads. */
    LAZYGRID_ERROR_THREADS = 6,
    /* The settings require a GPU, and none can be used. */
    LAZYGRID_ERROR_GPU_UNAVAILABLE = 7,
    /* The input or the result exceeds a limit of the GPU. */
    LAZYGRID_ERROR_DEVICE_LIMIT = 8,
    /* The GPU was lost or rejected a call; create a new detector. */
    LAZYGRID_ERROR_DEVICE_LOST = 9,
    /* The GPU did not finish in time. */
    LAZYGRID_ERROR_TIMEOUT = 10,
    /* Another thread uses the detector, or a callback searches. Without a message. */
    LAZYGRID_ERROR_BUSY = 11,
    /* A bug in the library. Destroy the detector. */
    LAZYGRID_ERROR_INTERNAL = 12
};

/* AUTO uses a hardware GPU if one exists and a call has enough spheres, otherwise the CPU. */
enum { LAZYGRID_BACKEND_AUTO = 0, LAZYGRID_BACKEND_CPU = 1, LAZYGRID_BACKEND_GPU = 2 };

/* All find the same pairs; AUTO chooses at each call and suits almost all programs. */
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

/* CANONICAL sorts pairs by i, then j. UNORDERED omits the sort. */
enum { LAZYGRID_ORDER_CANONICAL = 0, LAZYGRID_ORDER_UNORDERED = 1 };

/*
 * The skin of the candidate list (Verlet list) that a detector may reuse between calls. Results never depend on it.
 * AUTO keeps a list if the displacements predict that it saves time; the prediction uses no clock. OFF rebuilds at each
 * call. FIXED keeps the pairs within `skin_distance` of touching until a sphere has moved by half of it; only with
 * LAZYGRID_ALGORITHM_AUTO and _CELL_LIST.
 */
enum { LAZYGRID_SKIN_AUTO = 0, LAZYGRID_SKIN_OFF = 1, LAZYGRID_SKIN_FIXED = 2 };

/* The condition for two spheres of given species to pair. */
enum {
    LAZYGRID_NEVER = 0,
    LAZYGRID_TOUCH = 1, /* centers at most ri + rj apart */
    LAZYGRID_WITHIN = 2 /* centers at most a given distance apart, for any radii */
};

/* Finds pairs, reusing its memory between calls. */
typedef struct lazygrid_detector lazygrid_detector;

/* A symmetric table of the condition for any two species to pair. */
typedef struct lazygrid_interactions lazygrid_interactions;

/* Pairs that a search never reports, such as bonds. */
typedef struct lazygrid_exclusions lazygrid_exclusions;

/* The group number of spheres without a group. */
#define LAZYGRID_NO_GROUP 4294967295u

/*
 * Two overlapping spheres by input index; i < j. For two sets, `i` is an index in the first and `j` in the second, and
 * either may be larger.
 */
typedef struct lazygrid_pair {
    uint32_t i;
    uint32_t j;
} lazygrid_pair;

/* The settings of a detector; 0 is the default of each field. lazygrid_settings_init sets `size`. */
typedef struct lazygrid_settings {
    size_t size;              /* sizeof(lazygrid_settings) */
    int32_t backend;          /* LAZYGRID_BACKEND_... */
    int32_t algorithm;        /* LAZYGRID_ALGORITHM_... */
    int32_t order;            /* LAZYGRID_ORDER_... */
    uint32_t threads;         /* CPU threads; 0: all that the process may use, shared by all detectors */
    uint64_t max_pairs;       /* maximum length of a list, 8 bytes per pair; 0: 2^29. Counts and streams have no limit */
    double periodic[3];       /* the length of each periodic axis x, y, z; 0: unbounded */
    uint32_t timeout_seconds; /* limit of each submission to the GPU; a call may have several; 0: ten minutes. Searches
                                 on the CPU have no limit: LAZYGRID_BACKEND_CPU refuses one, and with
                                 LAZYGRID_BACKEND_AUTO it is unused if no GPU is found */
    int32_t skin;             /* LAZYGRID_SKIN_... */
    double skin_distance;     /* for LAZYGRID_SKIN_FIXED, 1e-14 to 1e17, in the unit of the spheres; otherwise 0 */
    const char *adapter;      /* a GPU by its index, or by a unique part of its name in UTF-8; or NULL */
    const lazygrid_interactions *interactions; /* copied by lazygrid_create; NULL: all touching spheres are pairs */
    const double *cell_vectors; /* 9 doubles: three cell vectors x, y, z of a triclinic cell; 0, 0, 0: space is not
                                 periodic along this vector. Read by lazygrid_create. If it is not NULL, `periodic` must
                                 be 0 */
} lazygrid_settings;

/* The type of the numbers of spheres. */
enum {
    LAZYGRID_F32 = 0, /* float */
    LAZYGRID_F64 = 1  /* double */
};

/*
 * A set of spheres, read in place: rows, columns, points with one radius, arrays of structures, `x[0]` of a `double
 * **`. Create it by a function such as lazygrid_rows, then set `species` and `groups` if needed.
 *
 * Value k of x is at `x` plus k * `step` bytes, as for y and z, and for r with `r_step`. Both steps are multiples of
 * the size of a number. `step` must not be 0 for two or more spheres; `r_step` 0 gives all spheres the radius at `r`.
 * Pointers are aligned like numbers. From its first to its last value, the memory at each pointer is part of one array,
 * whose gaps may hold any bytes. With count 0 no pointer is read.
 *
 * `species` has `count` ids below the number of species of the detector's table; without a table it may be NULL.
 * `groups` has `count` numbers, or is NULL: two spheres of one group, such as a molecule or a rigid body, never pair,
 * unless the group is LAZYGRID_NO_GROUP. Equal numbers in two sets are one group.
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

/* A query. Create it by lazygrid_among or lazygrid_across, then set `exclusions` if needed. */
typedef struct lazygrid_query {
    size_t size;                    /* sizeof(lazygrid_query) */
    const lazygrid_spheres *first;  /* the only set, or the first of two */
    const lazygrid_spheres *second; /* the second set; NULL: the pairs among `first` */
    const lazygrid_exclusions *exclusions; /* made for these numbers of spheres, or NULL. Excluded pairs are neither
                                              counted nor listed. May change from call to call */
} lazygrid_query;

/* `count` spheres in any layout; see lazygrid_spheres. */
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

/* As lazygrid_rows, with doubles. */
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

/* As lazygrid_columns, with doubles. */
static inline lazygrid_spheres lazygrid_columns_f64(size_t count, const double *x, const double *y, const double *z,
                                                    const double *r) {
    return lazygrid_strided(LAZYGRID_F64, count, x, y, z, sizeof(double), r, sizeof(double));
}

/*
 * `count` points, 3 * `count` floats x, y, z, x, y, ..., all with the radius at `radius`, which must outlive the
 * spheres. Half a cutoff as the radius finds the points within the cutoff.
 */
static inline lazygrid_spheres lazygrid_points(size_t count, const float *centers, const float *radius) {
    const size_t step = 3 * sizeof(float);
    if (centers == NULL) return lazygrid_strided(LAZYGRID_F32, count, NULL, NULL, NULL, step, radius, 0);
    return lazygrid_strided(LAZYGRID_F32, count, centers, centers + 1, centers + 2, step, radius, 0);
}

/* As lazygrid_points, with doubles. */
static inline lazygrid_spheres lazygrid_points_f64(size_t count, const double *centers, const double *radius) {
    const size_t step = 3 * sizeof(double);
    if (centers == NULL) return lazygrid_strided(LAZYGRID_F64, count, NULL, NULL, NULL, step, radius, 0);
    return lazygrid_strided(LAZYGRID_F64, count, centers, centers + 1, centers + 2, step, radius, 0);
}

/* A query for the pairs among `spheres`, whose pointer it keeps. */
static inline lazygrid_query lazygrid_among(const lazygrid_spheres *spheres) {
    lazygrid_query query = {sizeof(lazygrid_query), spheres, NULL, NULL};
    return query;
}

/*
 * A query for the pairs of one sphere of `first` and one of `second`, such as particles and receivers. It keeps both
 * pointers. Both may be the same spheres; each then pairs with itself. A message about `second` begins with "in the
 * second set, ".
 */
static inline lazygrid_query lazygrid_across(const lazygrid_spheres *first, const lazygrid_spheres *second) {
    lazygrid_query query = {sizeof(lazygrid_query), first, second, NULL};
    return query;
}

/*
 * Receives `count` pairs of a stream, which live until it returns. Returns 0 to continue; any other value ends the
 * search. The library may call it from another thread, but never concurrently. No exception and no longjmp may leave
 * it. It must not search with any detector, nor wait for another thread's search, because searches need threads that
 * wait for the callback; a search in the same thread returns LAZYGRID_ERROR_BUSY.
 */
typedef int32_t (*lazygrid_pair_callback)(void *context, const lazygrid_pair *pairs, size_t count);

/* The library version, such as "0.1.0". */
LAZYGRID_API const char *lazygrid_version(void);

/* The name of a status, such as "LAZYGRID_OK"; "unknown status" for any other number. */
LAZYGRID_API const char *lazygrid_status_name(lazygrid_status status);

/*
 * The error message of the last call with `detector`, in UTF-8; "" if it succeeded. With NULL: the message of this
 * thread's last call without a detector (lazygrid_create, lazygrid_settings_init, the functions for interactions and
 * exclusions, and any call with NULL as its detector). The text lives until the next such call, except calls of this
 * function.
 */
LAZYGRID_API const char *lazygrid_last_error(const lazygrid_detector *detector);

/* Sets all fields to their defaults, and `size`: lazygrid_settings_init(&settings, sizeof settings). */
LAZYGRID_API lazygrid_status lazygrid_settings_init(lazygrid_settings *settings, size_t size);

/*
 * Creates a table for species 0 to `species` - 1, at most 4096, in which any two species have the interaction `kind`
 * (LAZYGRID_NEVER, _TOUCH or _WITHIN). Only LAZYGRID_WITHIN uses `distance`. One thread at a time may use a table.
 */
LAZYGRID_API lazygrid_status lazygrid_interactions_create(uint32_t species, int32_t kind, double distance,
                                                          lazygrid_interactions **interactions);

/* Sets the interaction of `a` and `b`, in both orders. If it fails, the table is unchanged. */
LAZYGRID_API lazygrid_status lazygrid_interactions_set(lazygrid_interactions *interactions, uint32_t a, uint32_t b,
                                                       int32_t kind, double distance);

/* Frees a table. Detectors keep their copies. Ignores NULL. */
LAZYGRID_API void lazygrid_interactions_destroy(lazygrid_interactions *interactions);

/*
 * Creates exclusions from `count` pairs of `spheres` spheres, in either order and possibly repeated; a pair of a sphere
 * with itself has no effect. Exclusions never change, so any threads may share them; they must outlive the queries that
 * name them.
 */
LAZYGRID_API lazygrid_status lazygrid_exclusions_create(size_t spheres, const lazygrid_pair *pairs, size_t count,
                                                        lazygrid_exclusions **exclusions);

/* As lazygrid_exclusions_create, for two sets of `first` and `second` spheres: `i` is an index in the first, `j` in
   the second. */
LAZYGRID_API lazygrid_status lazygrid_exclusions_across(size_t first, size_t second, const lazygrid_pair *pairs,
                                                         size_t count, lazygrid_exclusions **exclusions);

/*
 * Creates exclusions from compressed sparse rows in the layout of lazygrid_neighbors: `offsets` has `spheres` + 1
 * values, and the last is the length of `indices`. One of the two rows of a pair suffices. Rows may be in any order.
 */
LAZYGRID_API lazygrid_status lazygrid_exclusions_from_csr(size_t spheres, const uint64_t *offsets, const uint32_t *indices,
                                                         lazygrid_exclusions **exclusions);

/* Frees exclusions. Ignores NULL. */
LAZYGRID_API void lazygrid_exclusions_destroy(lazygrid_exclusions *exclusions);

/* Creates a detector and chooses its backend. `settings` may be NULL for the defaults. */
LAZYGRID_API lazygrid_status lazygrid_create(const lazygrid_settings *settings, lazygrid_detector **detector);

/*
 * Frees a detector and the arrays that it returned. Ignores NULL. While a search runs, it returns LAZYGRID_ERROR_BUSY
 * and frees nothing; but no thread may begin a search at the same moment.
 */
LAZYGRID_API lazygrid_status lazygrid_destroy(lazygrid_detector *detector);

/* Finds the overlapping pairs. With LAZYGRID_ERROR_TOO_MANY_PAIRS, `*count` is their exact number. */
LAZYGRID_API lazygrid_status lazygrid_pairs(lazygrid_detector *detector, const lazygrid_query *query,
                                            const lazygrid_pair **pairs, uint64_t *count);

/* Counts the pairs, in memory independent of their number. */
LAZYGRID_API lazygrid_status lazygrid_count(lazygrid_detector *detector, const lazygrid_query *query, uint64_t *count);

/*
 * Finds the pairs as neighbor lists in compressed sparse rows: the neighbors of sphere k are `indices[offsets[k]]` to
 * `indices[offsets[k + 1] - 1]`, ascending. For one set each pair is in both lists; for two sets the spheres of the
 * first list neighbors in the second. `*offsets` has one more value than there are lists; the last is the length of
 * `*indices`. With LAZYGRID_ERROR_TOO_MANY_PAIRS, `**offsets` is the exact number of pairs.
 */
LAZYGRID_API lazygrid_status lazygrid_neighbors(lazygrid_detector *detector, const lazygrid_query *query,
                                                const uint64_t **offsets, const uint32_t **indices);

/*
 * Passes the pairs to `consume` with `context` in chunks of at most `chunk`, 1 or more, in bounded memory, and writes
 * the number of delivered pairs. In canonical order each `max_pairs` pairs take another search; if that would be more
 * than 16 searches, parts are larger, up to a quarter of the number of spheres.
 */
LAZYGRID_API lazygrid_status lazygrid_stream(lazygrid_detector *detector, const lazygrid_query *query, size_t chunk,
                                             lazygrid_pair_callback consume, void *context, uint64_t *delivered);

/* Options of lazygrid_neighbor_list, combined by addition. HALF and SELF do not affect two sets. */
enum {
    LAZYGRID_LIST_HALF = 1, /* each pair once instead of twice: i < j, and one of two opposite images of a sphere */
    LAZYGRID_LIST_OPEN = 2, /* distances below the cutoff only, like ASE; without it touching counts */
    LAZYGRID_LIST_SELF = 4, /* each sphere is its own neighbor at distance 0, unless its cutoff with itself is 0 */
    LAZYGRID_LIST_SHIFTS = 8,
    LAZYGRID_LIST_VECTORS = 16,
    LAZYGRID_LIST_DISTANCES = 32
};

/*
 * A neighbor list with `length` entries; sphere k has `offsets[k]` to `offsets[k + 1] - 1`. Arrays without their option
 * are NULL.
 */
typedef struct lazygrid_list {
    uint64_t length;
    const uint64_t *offsets;
    const lazygrid_pair *pairs;  /* the sphere and its neighbor; in a full list i may be the larger index */
    const int32_t (*shifts)[3];  /* multiples of the cell vectors that lead to the neighbor's image */
    const double (*vectors)[3];  /* from the sphere to that image */
    const double *distances;
} lazygrid_list;

/*
 * Finds the neighbor list with all periodic images within the cutoff, in a smaller box also a sphere's own. Computes in
 * double precision and sorts by i, j and the shift. Exclusions and groups apply to all images. With
 * LAZYGRID_ERROR_TOO_MANY_PAIRS, `list->length` is the exact number of pairs.
 */
LAZYGRID_API lazygrid_status lazygrid_neighbor_list(lazygrid_detector *detector, const lazygrid_query *query,
                                                    uint32_t options, lazygrid_list *list);

/*
 * Returns the report of the last search as one JSON object: "spheres" and "pairs" (numbers; for two sets the spheres of
 * both), "backend", "adapter" (null on the CPU), "algorithm", "reason", "gpu" (the cost of a GPU call: "dispatches",
 * "working_bytes", "pair_bytes", "traffic_bytes"; null on the CPU), "candidates" (the candidate list: "count", "age" in
 * calls, "displacement_fraction", the largest used fraction of a displacement limit from 0 to 1, "rebuilt", the reason
 * of a rebuild in this call or null; null without a list), "phases" (seconds by name, in order). Later versions may add
 * names. The text lives until the next lazygrid_report_json with that detector.
 */
LAZYGRID_API lazygrid_status lazygrid_report_json(lazygrid_detector *detector, const char **json);

/*
 * Estimates the bytes for `spheres` spheres (at most 2^32 - 2), without the result; on the CPU an upper bound.
 * UINT64_MAX if a GPU cannot hold them.
 */
LAZYGRID_API lazygrid_status lazygrid_memory_for(lazygrid_detector *detector, uint64_t spheres, uint64_t *bytes);

#ifdef __cplusplus
}
#endif

#endif
