// lazygrid for C++17: lazygrid.h with objects that free themselves, views instead of pointers, and exceptions.
//
//     lazygrid::Detector detector;
//     std::vector<lazygrid::Sphere> spheres = {{0, 0, 0, 1}, {1.5f, 0, 0, 1}};
//     for (const lazygrid::Pair &pair : detector.pairs(spheres)) collide(pair.i, pair.j);
//
// The rules of lazygrid.h apply: a view lives until the next search with its detector, and one thread at a time may use
// a detector. Every failure throws lazygrid::Error.
#ifndef LAZYGRID_HPP
#define LAZYGRID_HPP

#include <lazygrid.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#if defined(__has_include) && __cplusplus >= 202002L
#if __has_include(<ranges>)
#include <ranges>
#endif
#endif

namespace lazygrid {

// The failure of a call; what() names the value, the limit and the remedy.
class Error : public std::runtime_error {
public:
    Error(lazygrid_status status, const std::string &message) : std::runtime_error(message), status_(status) {}
    // LAZYGRID_ERROR_...
    lazygrid_status status() const noexcept { return status_; }

private:
    lazygrid_status status_;
};

// Invalid input: not finite, a negative radius, an unknown species.
class InputError : public Error {
public:
    using Error::Error;
};

// More pairs than Settings::max_pairs.
class TooManyPairs : public Error {
public:
    TooManyPairs(const std::string &message, std::uint64_t found)
        : Error(LAZYGRID_ERROR_TOO_MANY_PAIRS, message), found_(found) {}
    // The exact number.
    std::uint64_t found() const noexcept { return found_; }

private:
    std::uint64_t found_;
};

// Two spheres by their indices; i < j, or, for two sets, i in the first and j in the second.
using Pair = lazygrid_pair;

// One row of the input, in the caller's length unit.
struct Sphere {
    float x, y, z, r;
};
static_assert(sizeof(Sphere) == 4 * sizeof(float), "rows are four floats");

// A row in double precision.
struct SphereF64 {
    double x, y, z, r;
};
static_assert(sizeof(SphereF64) == 4 * sizeof(double), "rows are four doubles");

// A view of values; std::span can be constructed from it.
template <class T> class View {
public:
    using value_type = T;
    using const_iterator = const T *;

    View() = default;
    View(const T *data, std::size_t size) : data_(data), size_(size) {}
    const T *data() const noexcept { return data_; }
    std::size_t size() const noexcept { return size_; }
    bool empty() const noexcept { return size_ == 0; }
    const T *begin() const noexcept { return data_; }
    const T *end() const noexcept { return data_ + size_; }
    const T &operator[](std::size_t k) const noexcept { return data_[k]; }

private:
    const T *data_ = nullptr;
    std::size_t size_ = 0;
};

// The neighbors of each sphere, ascending. For one set each pair is in both lists, for two sets in the first sphere's.
struct Neighbors {
    // The start of each list, and the end of the last one.
    View<std::uint64_t> offsets;
    View<std::uint32_t> indices;

    // The neighbors of sphere k.
    View<std::uint32_t> neighbors_of(std::size_t k) const noexcept {
        const auto first = static_cast<std::size_t>(offsets[k]), last = static_cast<std::size_t>(offsets[k + 1]);
        return {indices.data() + first, last - first};
    }
};

// A neighbor list with geometry. Views without their option are empty.
struct NeighborList {
    // The start of each sphere's entries, and the end of the last one.
    View<std::uint64_t> offsets;
    // The sphere and its neighbor; in a full list i may be the larger index.
    View<Pair> pairs;
    // Multiples of the cell vectors that lead to the neighbor's image.
    View<std::int32_t[3]> shifts;
    // From the sphere to that image.
    View<double[3]> vectors;
    View<double> distances;
};

namespace detail {

[[noreturn]] inline void fail(lazygrid_status status, const std::string &message) {
    if (status == LAZYGRID_ERROR_INPUT) throw InputError(status, message);
    throw Error(status, message);
}

inline void check(lazygrid_status status, const lazygrid_detector *detector) {
    if (status == LAZYGRID_OK) return;
    // LAZYGRID_ERROR_BUSY has no message.
    const bool is_busy = status == LAZYGRID_ERROR_BUSY;
    fail(status, is_busy ? "the detector is in use, or a callback searches" : lazygrid_last_error(detector));
}

// `found` is the number of pairs if there are too many.
inline void check(lazygrid_status status, const lazygrid_detector *detector, std::uint64_t found) {
    if (status == LAZYGRID_ERROR_TOO_MANY_PAIRS) throw TooManyPairs(lazygrid_last_error(detector), found);
    check(status, detector);
}

// C reads a null pointer as an optional argument that was not given.
inline std::string moved_from(const char *what) {
    return std::string("the ") + what + " were moved to another object; pass that object";
}

// The type that data() of a container points to.
template <class Rows>
using Row = std::remove_cv_t<std::remove_pointer_t<decltype(std::declval<const Rows &>().data())>>;

// LAZYGRID_F32 or LAZYGRID_F64.
template <class T> constexpr std::int32_t type_of() {
    static_assert(std::is_same_v<T, float> || std::is_same_v<T, double>, "numbers are float or double");
    return std::is_same_v<T, float> ? LAZYGRID_F32 : LAZYGRID_F64;
}

// Null if `first` is null.
template <class T> const T *offset(const T *first, std::size_t k) { return first == nullptr ? nullptr : first + k; }

} // namespace detail

// Pairs that a search never reports, such as bonds. Immutable; copies share the data. A search refuses moved-from ones.
class Exclusions {
public:
    // Pairs of `spheres` spheres, in any order, in a contiguous range with data() and size(), such as
    // std::vector<Pair>.
    template <class Pairs> Exclusions(std::size_t spheres, const Pairs &pairs) {
        take([&](auto **made) { return lazygrid_exclusions_create(spheres, pairs.data(), pairs.size(), made); });
    }
    // Pairs of one sphere of each of two sets, of `first` and `second` spheres.
    template <class Pairs> static Exclusions across(std::size_t first, std::size_t second, const Pairs &pairs) {
        return Exclusions([&](auto **made) {
            return lazygrid_exclusions_across(first, second, pairs.data(), pairs.size(), made);
        });
    }
    // The pairs of neighbor lists, such as from Detector::neighbors. Throws InputError if the last offset is beyond the
    // indices.
    static Exclusions from_csr(const Neighbors &lists) {
        if (lists.offsets.empty()) detail::fail(LAZYGRID_ERROR_INPUT, "the lists have no offsets; pass one per sphere and the end");
        // The library reads as many indices as the last offset says.
        const std::uint64_t last = lists.offsets[lists.offsets.size() - 1];
        if (last > lists.indices.size()) {
            detail::fail(LAZYGRID_ERROR_INPUT, "the last offset is " + std::to_string(last) + ", but there are "
                                                   + std::to_string(lists.indices.size())
                                                   + " indices; it must be the number of indices");
        }
        return Exclusions([&](auto **made) {
            return lazygrid_exclusions_from_csr(lists.offsets.size() - 1, lists.offsets.data(), lists.indices.data(), made);
        });
    }
    const lazygrid_exclusions *get() const noexcept { return list_.get(); }

private:
    template <class Make, class = std::enable_if_t<std::is_invocable_v<const Make &, lazygrid_exclusions **>>>
    explicit Exclusions(const Make &make) {
        take(make);
    }
    template <class Make> void take(const Make &make) {
        lazygrid_exclusions *made = nullptr;
        detail::check(make(&made), nullptr);
        list_.reset(made, lazygrid_exclusions_destroy);
    }
    std::shared_ptr<const lazygrid_exclusions> list_;
};

// The group number of spheres without a group.
inline constexpr std::uint32_t no_group = LAZYGRID_NO_GROUP;

// Spheres of float or double in the caller's memory, which must outlive it, with or without species and groups.
class Spheres {
public:
    // A contiguous range with data() and size(), such as std::vector<Sphere> or std::vector<SphereF64>.
    template <class Rows, class = std::enable_if_t<std::is_same_v<detail::Row<Rows>, Sphere>
                                                   || std::is_same_v<detail::Row<Rows>, SphereF64>>>
    Spheres(const Rows &rows) : Spheres(rows.data(), rows.size()) {}
    Spheres(const Sphere *rows, std::size_t count) : Spheres(lazygrid_rows(count, count == 0 ? nullptr : &rows->x)) {}
    Spheres(const SphereF64 *rows, std::size_t count)
        : Spheres(lazygrid_rows_f64(count, count == 0 ? nullptr : &rows->x)) {}
    // Rows as 4 * count numbers x, y, z, r.
    static Spheres rows(const float *rows, std::size_t count) { return Spheres(lazygrid_rows(count, rows)); }
    static Spheres rows(const double *rows, std::size_t count) { return Spheres(lazygrid_rows_f64(count, rows)); }
    // Four columns of `count` values each.
    template <class T>
    static Spheres columns(const T *x, const T *y, const T *z, const T *r, std::size_t count) {
        return strided(x, y, z, sizeof(T), r, sizeof(T), count);
    }
    // Four columns of one length, such as std::vector<float>. Throws InputError if the lengths differ.
    template <class Column> static Spheres columns(const Column &x, const Column &y, const Column &z, const Column &r) {
        if (x.size() != y.size() || x.size() != z.size() || x.size() != r.size()) {
            detail::fail(LAZYGRID_ERROR_INPUT, "the columns x, y, z and r differ in length");
        }
        return columns(x.data(), y.data(), z.data(), r.data(), x.size());
    }
    // Points, as 3 * count numbers x, y, z, with one radius, which must outlive this. Half a cutoff as the radius finds
    // the points within the cutoff.
    template <class T> static Spheres points(const T *centers, std::size_t count, const T &radius) {
        return strided(centers, detail::offset(centers, 1), detail::offset(centers, 2), 3 * sizeof(T), &radius, 0, count);
    }
    template <class T> static Spheres points(const T *centers, std::size_t count, const T &&radius) = delete;
    // Numbers at regular distances: `step` bytes from one center to the next, `r_step` from one radius to the next, 0
    // for one radius; such as strided(&p->x, &p->y, &p->z, sizeof *p, &p->r, sizeof *p, count).
    template <class T>
    static Spheres strided(const T *x, const T *y, const T *z, std::size_t step, const T *r, std::size_t r_step,
                           std::size_t count) {
        return Spheres(lazygrid_strided(detail::type_of<T>(), count, x, y, z, step, r, r_step));
    }
    // These spheres with species ids. Throws InputError unless there is one per sphere.
    template <class Ids> Spheres with_species(const Ids &ids) const {
        Spheres with = *this;
        with.given_.species = one_each(ids, "species ids");
        return with;
    }
    // These spheres with groups: two spheres of one group never pair, unless it is no_group. Throws InputError unless
    // there is one per sphere.
    template <class Groups> Spheres with_groups(const Groups &groups) const {
        Spheres with = *this;
        with.given_.groups = one_each(groups, "groups");
        return with;
    }
    const lazygrid_spheres *get() const noexcept { return &given_; }
    std::size_t size() const noexcept { return given_.count; }

private:
    explicit Spheres(const lazygrid_spheres &given) : given_(given) {}
    template <class Values> const std::uint32_t *one_each(const Values &values, const char *what) const {
        if (values.size() != given_.count) {
            detail::fail(LAZYGRID_ERROR_INPUT, std::to_string(values.size()) + " " + what + " for "
                                                   + std::to_string(given_.count) + " spheres; give one each");
        }
        return values.data();
    }
    lazygrid_spheres given_;
};

// One set of spheres or two, with optional exclusions; see lazygrid.h. Searches also accept spheres directly, and two
// sets as {a, b}. Spheres and exclusions must outlive the query.
class Query {
public:
    Query(const Spheres &of) : first_(*of.get()) {}
    // Any range that converts to spheres, such as std::vector<Sphere>.
    template <class Rows, class = std::enable_if_t<!std::is_same_v<Rows, Spheres> && !std::is_same_v<Rows, Query>
                                                   && std::is_convertible_v<const Rows &, Spheres>>>
    Query(const Rows &rows) : Query(Spheres(rows)) {}
    // Pairs of one sphere of `first` and one of `second`.
    Query(const Spheres &first, const Spheres &second) : first_(*first.get()), second_(*second.get()), is_across_(true) {}
    // This query without these pairs. Throws Error for moved-from exclusions.
    Query without(const Exclusions &exclusions) const {
        if (exclusions.get() == nullptr) detail::fail(LAZYGRID_ERROR_ARGUMENT, detail::moved_from("exclusions"));
        Query with = *this;
        with.exclusions_ = exclusions.get();
        return with;
    }
    // The C structure, which points into this object.
    lazygrid_query get() const noexcept {
        lazygrid_query query = is_across_ ? lazygrid_across(&first_, &second_) : lazygrid_among(&first_);
        query.exclusions = exclusions_;
        return query;
    }
    // The number of spheres of the only or first set.
    std::size_t size() const noexcept { return first_.count; }

private:
    lazygrid_spheres first_;
    lazygrid_spheres second_ = {};
    bool is_across_ = false;
    const lazygrid_exclusions *exclusions_ = nullptr;
};

// Options of a neighbor list; see LAZYGRID_LIST_...
struct ListOptions {
    bool half = false, open = false, self = false;
    bool shifts = false, vectors = false, distances = false;

    std::uint32_t bits() const noexcept {
        const auto bit = [](bool is_set, std::uint32_t value) { return is_set ? value : 0u; };
        return bit(half, LAZYGRID_LIST_HALF) | bit(open, LAZYGRID_LIST_OPEN) | bit(self, LAZYGRID_LIST_SELF)
               | bit(shifts, LAZYGRID_LIST_SHIFTS) | bit(vectors, LAZYGRID_LIST_VECTORS)
               | bit(distances, LAZYGRID_LIST_DISTANCES);
    }
};

// The condition for two spheres of given species to pair.
class Interaction {
public:
    static Interaction never() { return {LAZYGRID_NEVER, 0}; }
    // Centers at most ri + rj apart.
    static Interaction touch() { return {LAZYGRID_TOUCH, 0}; }
    // Centers at most `distance` apart, for any radii.
    static Interaction within(double distance) { return {LAZYGRID_WITHIN, distance}; }

private:
    friend class Interactions;
    Interaction(std::int32_t kind, double distance) : kind(kind), distance(distance) {}
    std::int32_t kind;
    double distance;
};

// A symmetric table of the condition for any two species to pair.
class Interactions {
public:
    // For species 0 to `species` - 1, all with the interaction `all`.
    Interactions(std::uint32_t species, Interaction all) {
        lazygrid_interactions *made = nullptr;
        detail::check(lazygrid_interactions_create(species, all.kind, all.distance, &made), nullptr);
        table_.reset(made);
    }
    // Sets the interaction in both orders.
    Interactions &set(std::uint32_t a, std::uint32_t b, Interaction interaction) {
        detail::check(lazygrid_interactions_set(table_.get(), a, b, interaction.kind, interaction.distance), nullptr);
        return *this;
    }
    const lazygrid_interactions *get() const noexcept { return table_.get(); }

private:
    struct Destroy {
        void operator()(lazygrid_interactions *table) const noexcept { lazygrid_interactions_destroy(table); }
    };
    std::unique_ptr<lazygrid_interactions, Destroy> table_;
};

enum class Backend : std::int32_t {
    automatic = LAZYGRID_BACKEND_AUTO,
    cpu = LAZYGRID_BACKEND_CPU,
    gpu = LAZYGRID_BACKEND_GPU
};

enum class Algorithm : std::int32_t {
    automatic = LAZYGRID_ALGORITHM_AUTO,
    naive = LAZYGRID_ALGORITHM_NAIVE,
    hash_grid = LAZYGRID_ALGORITHM_HASH_GRID,
    array_grid = LAZYGRID_ALGORITHM_ARRAY_GRID,
    recursive_grid = LAZYGRID_ALGORITHM_RECURSIVE_GRID,
    cell_list = LAZYGRID_ALGORITHM_CELL_LIST,
    eager_grid = LAZYGRID_ALGORITHM_EAGER_GRID,
    lazy_grid = LAZYGRID_ALGORITHM_LAZY_GRID
};

enum class Order : std::int32_t { canonical = LAZYGRID_ORDER_CANONICAL, unordered = LAZYGRID_ORDER_UNORDERED };

// The skin of the candidate list; see LAZYGRID_SKIN_...
class Skin {
public:
    // Keeps a list if the displacements predict that it saves time.
    static Skin automatic() { return {LAZYGRID_SKIN_AUTO, 0}; }
    static Skin off() { return {LAZYGRID_SKIN_OFF, 0}; }
    // Keeps the pairs within `distance` of touching until a sphere has moved by half of it.
    static Skin fixed(double distance) { return {LAZYGRID_SKIN_FIXED, distance}; }

private:
    friend class Detector;
    Skin(std::int32_t kind, double distance) : kind(kind), distance(distance) {}
    std::int32_t kind;
    double distance;
};

// See lazygrid_settings.
struct Settings {
    Backend backend = Backend::automatic;
    Algorithm algorithm = Algorithm::automatic;
    Order order = Order::canonical;
    std::uint32_t threads = 0;
    std::uint64_t max_pairs = 0;
    // The length of each periodic axis; 0: unbounded.
    std::array<double, 3> periodic = {0, 0, 0};
    // The cell vectors of a triclinic cell, instead of `periodic`. Space is not periodic along a vector that is 0.
    std::array<std::array<double, 3>, 3> cell_vectors = {};
    std::chrono::duration<std::uint32_t> timeout = {};
    // A GPU by its index or a part of its name; empty: the best one.
    std::string adapter = {};
    // Copied by the constructor of Detector.
    const Interactions *interactions = nullptr;
    Skin skin = Skin::automatic();
};

// Finds pairs, reusing its memory between calls. A moved-from detector throws at each call.
class Detector {
public:
    explicit Detector(const Settings &settings = {}) {
        lazygrid_settings given;
        detail::check(lazygrid_settings_init(&given, sizeof given), nullptr);
        given.backend = static_cast<std::int32_t>(settings.backend);
        given.algorithm = static_cast<std::int32_t>(settings.algorithm);
        given.order = static_cast<std::int32_t>(settings.order);
        given.threads = settings.threads;
        given.max_pairs = settings.max_pairs;
        for (std::size_t axis = 0; axis < 3; axis++) given.periodic[axis] = settings.periodic[axis];
        given.timeout_seconds = settings.timeout.count();
        if (settings.adapter.find('\0') != std::string::npos) {
            detail::fail(LAZYGRID_ERROR_ARGUMENT, "the name of an adapter has a zero byte, which would end it; leave it out");
        }
        given.adapter = settings.adapter.empty() ? nullptr : settings.adapter.c_str();
        given.interactions = settings.interactions == nullptr ? nullptr : settings.interactions->get();
        if (settings.interactions != nullptr && given.interactions == nullptr) {
            detail::fail(LAZYGRID_ERROR_ARGUMENT, detail::moved_from("interactions"));
        }
        given.skin = settings.skin.kind;
        given.skin_distance = settings.skin.distance;
        static_assert(sizeof settings.cell_vectors == 9 * sizeof(double), "cell vectors are nine doubles");
        const std::array<std::array<double, 3>, 3> none = {};
        given.cell_vectors = settings.cell_vectors == none ? nullptr : settings.cell_vectors[0].data();
        lazygrid_detector *made = nullptr;
        detail::check(lazygrid_create(&given, &made), nullptr);
        detector_.reset(made);
    }

    // The overlapping pairs. Throws TooManyPairs above Settings::max_pairs, with their exact number.
    View<Pair> pairs(const Query &of) {
        const lazygrid_query query = of.get();
        const Pair *found = nullptr;
        std::uint64_t count = 0;
        const auto status = lazygrid_pairs(get(), &query, &found, &count);
        detail::check(status, get(), count);
        return {found, static_cast<std::size_t>(count)};
    }

    // The number of pairs, in memory independent of it.
    std::uint64_t count(const Query &of) {
        const lazygrid_query query = of.get();
        std::uint64_t count = 0;
        detail::check(lazygrid_count(get(), &query, &count), get());
        return count;
    }

    // The pairs as neighbor lists, one for each sphere of the only or first set. Throws TooManyPairs as pairs() does.
    Neighbors neighbors(const Query &of) {
        const lazygrid_query query = of.get();
        const std::uint64_t *offsets = nullptr;
        const std::uint32_t *indices = nullptr;
        const auto status = lazygrid_neighbors(get(), &query, &offsets, &indices);
        detail::check(status, get(), offsets == nullptr ? 0 : *offsets);
        const std::size_t count = of.size();
        return {{offsets, count + 1}, {indices, static_cast<std::size_t>(offsets[count])}};
    }

    // The neighbor list with all periodic images within the cutoff. Throws TooManyPairs as pairs() does.
    NeighborList neighbor_list(const Query &of, const ListOptions &options = {}) {
        const lazygrid_query query = of.get();
        lazygrid_list list;
        const auto status = lazygrid_neighbor_list(get(), &query, options.bits(), &list);
        detail::check(status, get(), list.length);
        const auto length = static_cast<std::size_t>(list.length);
        return {{list.offsets, of.size() + 1},
                {list.pairs, length},
                {list.shifts, options.shifts ? length : 0},
                {list.vectors, options.vectors ? length : 0},
                {list.distances, options.distances ? length : 0}};
    }

    // Passes the pairs to `consume` as View<Pair> of at most `chunk`, and returns the number of delivered pairs.
    // `consume` returns nothing, or false to end the search. Its exception ends the search and is rethrown. It may run
    // in any thread, never concurrently, and must not search.
    template <class F> std::uint64_t stream(const Query &of, std::size_t chunk, F &&consume) {
        const lazygrid_query query = of.get();
        Consuming<std::remove_reference_t<F>> consumer{consume, nullptr};
        std::uint64_t delivered = 0;
        const auto status = lazygrid_stream(get(), &query, chunk, &decltype(consumer)::take, &consumer, &delivered);
        if (consumer.thrown) std::rethrow_exception(consumer.thrown);
        detail::check(status, get());
        return delivered;
    }

    // The report of the last search, as JSON.
    std::string report_json() {
        const char *json = nullptr;
        detail::check(lazygrid_report_json(get(), &json), get());
        return json;
    }

    // Estimates the bytes for `spheres` spheres, without the result.
    std::uint64_t memory_for(std::uint64_t spheres) {
        std::uint64_t bytes = 0;
        detail::check(lazygrid_memory_for(get(), spheres, &bytes), get());
        return bytes;
    }

    // The C handle, which the detector owns.
    lazygrid_detector *get() const noexcept { return detector_.get(); }

private:
    template <class F> struct Consuming {
        F &consume;
        std::exception_ptr thrown;

        static std::int32_t take(void *context, const Pair *pairs, std::size_t count) noexcept {
            auto &own = *static_cast<Consuming *>(context);
            try {
                const View<Pair> chunk(pairs, count);
                if constexpr (std::is_void_v<decltype(own.consume(chunk))>) {
                    own.consume(chunk);
                    return 0;
                } else {
                    return own.consume(chunk) ? 0 : 1;
                }
            } catch (...) {
                own.thrown = std::current_exception();
                return 1;
            }
        }
    };
    struct Destroy {
        void operator()(lazygrid_detector *detector) const noexcept { lazygrid_destroy(detector); }
    };
    std::unique_ptr<lazygrid_detector, Destroy> detector_;
};

// The library version, such as "0.1.0".
inline std::string version() { return lazygrid_version(); }

} // namespace lazygrid

#if defined(__cpp_lib_ranges)
template <class T> inline constexpr bool std::ranges::enable_borrowed_range<lazygrid::View<T>> = true;
#endif

#endif
