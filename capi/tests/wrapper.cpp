// The additions of lazygrid.hpp to lazygrid.h: objects, views, exceptions.
#include <lazygrid.hpp>

#include <array>
#include <cmath>
#include <iostream>
#include <thread>
#include <vector>

#if __cplusplus >= 202002L
#include <span>
#endif

namespace {

int passed = 0, failed = 0;

#define CHECK(condition)                                                                     \
    do {                                                                                     \
        if (condition) {                                                                     \
            passed++;                                                                        \
        } else {                                                                             \
            failed++;                                                                        \
            std::cerr << __FILE__ << ":" << __LINE__ << ": not so: " << #condition << std::endl; \
        }                                                                                    \
    } while (false)

template <class E, class F> bool throws(F &&work, const char *text) {
    try {
        work();
    } catch (const E &error) {
        return std::string(error.what()).find(text) != std::string::npos;
    }
    return false;
}

lazygrid::Settings on_cpu() {
    lazygrid::Settings settings;
    settings.backend = lazygrid::Backend::cpu;
    return settings;
}

// Each touches the next.
std::vector<lazygrid::Sphere> line(std::size_t count) {
    std::vector<lazygrid::Sphere> spheres;
    for (std::size_t k = 0; k < count; k++) spheres.push_back({0.5f * static_cast<float>(k), 0, 0, 0.3f});
    return spheres;
}

void every_kind_of_input() {
    lazygrid::Detector detector(on_cpu());
    const std::vector<float> x = {0, 1.5f, 9}, zero(3), r = {1, 1, 0.1f};
    const std::array<lazygrid::Sphere, 3> rows = {{{0, 0, 0, 1}, {1.5f, 0, 0, 1}, {9, 0, 0, 0.1f}}};
    CHECK(detector.pairs(rows).size() == 1);
    CHECK(detector.count(lazygrid::Spheres::rows(&rows[0].x, 3)) == 1);
    CHECK(detector.count(lazygrid::Spheres::columns(x, zero, zero, r)) == 1);
    CHECK(detector.count(std::vector<lazygrid::Sphere>()) == 0);
    CHECK(detector.neighbors(std::vector<lazygrid::Sphere>()).indices.empty());
    CHECK(throws<lazygrid::InputError>([&] { lazygrid::Spheres::columns(x, zero, zero, {1}); }, "differ"));
    const std::vector<std::uint32_t> none;
    CHECK(throws<lazygrid::InputError>([&] { lazygrid::Spheres(rows).with_species(none); }, "one each"));
}

// Tangent at 1e9, where floats are 64 apart.
void doubles_of_every_layout() {
    struct Particle {
        float mass;
        double x, y, z, r;
    };
    lazygrid::Detector detector(on_cpu());
    const std::vector<lazygrid::SphereF64> rows = {{1e9, 1, 2, 0.5}, {1e9 + 1, 1, 2, 0.5}, {1e9 + 2.5, 1, 2, 0.5}};
    const double *first = &rows[0].x, radius = 0.5;
    std::vector<double> x, y, z, r, centers;
    std::vector<Particle> particles;
    for (const auto &row : rows) {
        x.push_back(row.x), y.push_back(row.y), z.push_back(row.z), r.push_back(row.r);
        centers.insert(centers.end(), {row.x, row.y, row.z});
        particles.push_back({7, row.x, row.y, row.z, row.r});
    }
    const Particle *p = particles.data();
    CHECK(detector.count(rows) == 1);
    CHECK(detector.count(lazygrid::Spheres::rows(first, 3)) == 1);
    CHECK(detector.count(lazygrid::Spheres::columns(x, y, z, r)) == 1);
    CHECK(detector.count(lazygrid::Spheres::points(centers.data(), 3, radius)) == 1);
    CHECK(detector.count(lazygrid::Spheres::strided(&p->x, &p->y, &p->z, sizeof *p, &p->r, sizeof *p, 3)) == 1);
    CHECK(detector.count(std::vector<lazygrid::SphereF64>()) == 0);
    // Each touches itself, and one pair touches in both orders.
    CHECK(detector.count({rows, lazygrid::Spheres::columns(x, y, z, r)}) == 5);
    const auto narrow = line(3);
    CHECK(detector.count({narrow, rows}) == 0);
    auto settings = on_cpu();
    settings.periodic = {10.1, 0, 0};
    lazygrid::Detector periodic(settings);
    CHECK(periodic.count(std::vector<lazygrid::SphereF64>{{0, 0, 0, 0.5}, {9.1, 0, 0, 0.5}}) == 1);
    CHECK(periodic.count(std::vector<lazygrid::SphereF64>{{0, 0, 0, 0.5}, {9.1 - 1e-12, 0, 0, 0.5}}) == 0);
}

void views_are_ranges() {
    lazygrid::Detector detector(on_cpu());
    const auto spheres = line(100);
    std::size_t seen = 0;
    for (const lazygrid::Pair &pair : detector.pairs(spheres)) seen += pair.j - pair.i;
    CHECK(seen == 99);
    const lazygrid::Neighbors neighbors = detector.neighbors(spheres);
    CHECK(neighbors.neighbors_of(0).size() == 1 && neighbors.neighbors_of(50).size() == 2 && neighbors.neighbors_of(50)[0] == 49);
#if __cplusplus >= 202002L
    const std::span<const lazygrid::Pair> span = detector.pairs(spheres);
    CHECK(span.size() == 99 && span.back().j == 99);
#endif
}

void errors_are_exceptions() {
    auto settings = on_cpu();
    settings.max_pairs = 5;
    lazygrid::Detector detector(settings);
    try {
        detector.pairs(line(100));
        CHECK(false);
    } catch (const lazygrid::TooManyPairs &error) {
        CHECK(error.found() == 99 && error.status() == LAZYGRID_ERROR_TOO_MANY_PAIRS);
    }
    try {
        detector.neighbors(line(100));
        CHECK(false);
    } catch (const lazygrid::TooManyPairs &error) {
        CHECK(error.found() == 99);
    }
    try {
        detector.neighbor_list(line(100));
        CHECK(false);
    } catch (const lazygrid::TooManyPairs &error) {
        CHECK(error.found() == 99);
    }
    auto bad = line(3);
    bad[2].r = NAN;
    CHECK(throws<lazygrid::InputError>([&] { detector.count(bad); }, "sphere 2"));
    settings.algorithm = lazygrid::Algorithm::lazy_grid;
    CHECK(throws<lazygrid::Error>([&] { lazygrid::Detector refused(settings); }, "does not run on the cpu backend"));
    lazygrid::Settings cut;
    cut.adapter = std::string("a\0b", 3);
    CHECK(throws<lazygrid::Error>([&] { lazygrid::Detector refused(cut); }, "zero byte"));
    lazygrid::Detector other = std::move(detector);
    CHECK(other.count(line(3)) == 2);
    CHECK(throws<lazygrid::Error>([&] { detector.count(line(3)); }, "NULL"));
}

void streams() {
    for (auto order : {lazygrid::Order::canonical, lazygrid::Order::unordered}) {
        auto settings = on_cpu();
        settings.order = order;
        settings.threads = 2;
        lazygrid::Detector detector(settings);
        const auto spheres = line(20000);
        std::size_t seen = 0;
        const auto count = [&](lazygrid::View<lazygrid::Pair> chunk) { seen += chunk.size(); };
        CHECK(detector.stream(spheres, 64, count) == 19999);
        CHECK(seen == 19999);
        CHECK(detector.stream(spheres, 64, [](auto) { return false; }) <= 64);
        const auto thrower = [](auto) { throw std::domain_error("enough"); };
        CHECK(throws<std::domain_error>([&] { detector.stream(spheres, 64, thrower); }, "enough"));
        bool is_busy = false;
        detector.stream(spheres, 64, [&](auto) {
            is_busy = throws<lazygrid::Error>([&] { detector.count(spheres); }, "in use");
            return false;
        });
        CHECK(is_busy);
        CHECK(detector.count(spheres) == 19999);
    }
}

void species_and_boxes() {
    lazygrid::Interactions reactions(2, lazygrid::Interaction::never());
    reactions.set(0, 1, lazygrid::Interaction::within(0.5f));
    auto settings = on_cpu();
    settings.interactions = &reactions;
    settings.periodic = {10, 0, 0};
    lazygrid::Detector detector(settings);
    const std::vector<lazygrid::Sphere> spheres = {{0.1f, 0, 0, 0}, {9.8f, 0, 0, 0}, {9.9f, 0, 0, 0}};
    const std::vector<std::uint32_t> species = {0, 1, 0};
    CHECK(detector.count(lazygrid::Spheres(spheres).with_species(species)) == 2);
    CHECK(throws<lazygrid::InputError>([&] { reactions.set(0, 2, lazygrid::Interaction::touch()); }, "species id 2"));
    CHECK(detector.report_json().find("\"pairs\":2") != std::string::npos);
    CHECK(detector.memory_for(1000) > 0);
    CHECK(lazygrid::version() == lazygrid_version());
}

void two_sets() {
    lazygrid::Detector detector(on_cpu());
    const auto spheres = line(100);
    const lazygrid::Spheres all(spheres), some(spheres.data() + 50, 20);
    // Each touches itself and both neighbors.
    CHECK(detector.count({some, all}) == 60);
    const auto pairs = detector.pairs({some, all});
    CHECK(pairs.size() == 60 && pairs[0].i == 0 && pairs[0].j == 49 && pairs[59].i == 19 && pairs[59].j == 70);
    const lazygrid::Neighbors neighbors = detector.neighbors({some, all});
    CHECK(neighbors.offsets.size() == 21 && neighbors.neighbors_of(7).size() == 3 && neighbors.neighbors_of(7)[0] == 56);
    std::size_t seen = 0;
    const auto count = [&](lazygrid::View<lazygrid::Pair> chunk) { seen += chunk.size(); };
    CHECK(detector.stream({some, all}, 16, count) == 60 && seen == 60);
    const auto thrower = [](auto) { throw std::domain_error("enough"); };
    CHECK(throws<std::domain_error>([&] { detector.stream({some, all}, 16, thrower); }, "enough"));
    auto bad = line(3);
    bad[2].r = NAN;
    CHECK(throws<lazygrid::InputError>([&] { detector.pairs({all, bad}); }, "in the second set, sphere 2"));
    auto settings = on_cpu();
    settings.max_pairs = 5;
    lazygrid::Detector small(settings);
    CHECK(throws<lazygrid::TooManyPairs>([&] { small.pairs({some, all}); }, "60"));
}

void geometry() {
    auto settings = on_cpu();
    settings.periodic = {2.5, 2.5, 2.5};
    lazygrid::Detector detector(settings);
    const std::vector<lazygrid::SphereF64> atom = {{0.5, 0.5, 0.5, 1.5}};
    lazygrid::ListOptions options;
    options.shifts = options.distances = true;
    const lazygrid::NeighborList list = detector.neighbor_list(atom, options);
    CHECK(list.pairs.size() == 6 && list.offsets[1] == 6 && list.vectors.empty());
    CHECK(list.distances[0] == 2.5 && list.shifts[0][0] == -1 && list.shifts[5][0] == 1);
    options.half = true;
    CHECK(detector.neighbor_list(atom, options).pairs.size() == 3);
}

void skins() {
    const auto spheres = line(2000);
    for (auto skin : {lazygrid::Skin::automatic(), lazygrid::Skin::off(), lazygrid::Skin::fixed(0.1f)}) {
        auto settings = on_cpu();
        settings.skin = skin;
        lazygrid::Detector detector(settings);
        CHECK(detector.count(spheres) == 1999 && detector.count(spheres) == 1999);
    }
    auto settings = on_cpu();
    settings.skin = lazygrid::Skin::fixed(0.1f);
    lazygrid::Detector detector(settings);
    detector.count(spheres);
    detector.count(spheres);
    CHECK(detector.report_json().find("\"age\":1,") != std::string::npos);
    settings.skin = lazygrid::Skin::fixed(-1);
    CHECK(throws<lazygrid::Error>([&] { lazygrid::Detector refused(settings); }, "skin = -1"));
}

void boxes_that_lean_and_what_is_left_out() {
    auto settings = on_cpu();
    settings.cell_vectors = {{{10, 0, 0}, {4, 10, 0}, {0, 0, 0}}};
    lazygrid::Detector detector(settings);
    const std::vector<lazygrid::Sphere> spheres = {{1, 0.2f, 0, 0.5f}, {5, 9.6f, 0, 0.5f}, {1, 0.9f, 0, 0.5f}};
    const lazygrid::Spheres all(spheres);
    CHECK(detector.count(all) == 2);
    const lazygrid::Exclusions bonds(3, std::vector<lazygrid::Pair>{{2, 0}, {0, 2}});
    const auto left = detector.pairs(lazygrid::Query(all).without(bonds));
    CHECK(left.size() == 1 && left[0].i == 0 && left[0].j == 1);
    const std::vector<std::uint32_t> molecules = {7, 7, lazygrid::no_group};
    CHECK(detector.count(all.with_groups(molecules)) == 1);
    CHECK(detector.count(lazygrid::Query(all.with_groups(molecules)).without(bonds)) == 0);
    CHECK(detector.count(lazygrid::Query(all).without(lazygrid::Exclusions::from_csr(detector.neighbors(all)))) == 0);
    const auto across = lazygrid::Exclusions::across(3, 3, std::vector<lazygrid::Pair>{{0, 0}, {1, 1}, {0, 1}});
    CHECK(detector.count(lazygrid::Query(all, all).without(across)) == 4);
    CHECK(throws<lazygrid::InputError>([&] { detector.count(lazygrid::Query(all).without(across)); }, "3"));
    CHECK(throws<lazygrid::InputError>([&] { detector.pairs(lazygrid::Query(all, all).without(bonds)); }, "3"));
    CHECK(throws<lazygrid::InputError>([&] { lazygrid::Exclusions(2, std::vector<lazygrid::Pair>{{0, 2}}); }, "(0, 2)"));
    CHECK(throws<lazygrid::InputError>([&] { all.with_groups(std::vector<std::uint32_t>{1}); }, "1 groups for 3"));
    settings.periodic = {1, 0, 0};
    CHECK(throws<lazygrid::Error>([&] { lazygrid::Detector refused(settings); }, "settings.cell_vectors"));
}

void moved_from_objects_and_short_lists_are_refused() {
    const auto spheres = line(3);
    lazygrid::Detector detector(on_cpu());
    lazygrid::Exclusions bonds(3, std::vector<lazygrid::Pair>{{0, 1}});
    const lazygrid::Exclusions moved = std::move(bonds);
    CHECK(detector.count(lazygrid::Query(spheres).without(moved)) == 1);
    CHECK(throws<lazygrid::Error>([&] { lazygrid::Query(spheres).without(bonds); }, "exclusions were moved"));
    lazygrid::Interactions table(1, lazygrid::Interaction::never());
    const lazygrid::Interactions other = std::move(table);
    auto settings = on_cpu();
    settings.interactions = &table;
    CHECK(throws<lazygrid::Error>([&] { lazygrid::Detector refused(settings); }, "interactions were moved"));
    settings.interactions = &other;
    lazygrid::Detector with_table(settings);
    const std::vector<std::uint64_t> offsets = {0, 1, 2, 100000};
    const std::vector<std::uint32_t> indices = {1, 0};
    lazygrid::Neighbors lists{{offsets.data(), 4}, {indices.data(), 2}};
    CHECK(throws<lazygrid::InputError>([&] { lazygrid::Exclusions::from_csr(lists); }, "the last offset is 100000"));
    lists.offsets = {offsets.data(), 3};
    CHECK(lazygrid::Exclusions::from_csr(lists).get() != nullptr);
}

// A thread per detector, and a detector that moves from thread to thread.
void threads() {
    std::array<std::uint64_t, 4> found{};
    std::vector<std::thread> workers;
    for (auto &mine : found) {
        workers.emplace_back([&mine] {
            lazygrid::Detector detector(on_cpu());
            const auto spheres = line(3000);
            for (int turn = 0; turn < 5; turn++) mine = detector.count(spheres);
        });
    }
    for (auto &worker : workers) worker.join();
    for (auto count : found) CHECK(count == 2999);
    lazygrid::Detector detector(on_cpu());
    const auto spheres = line(10);
    std::thread([&] { CHECK(detector.count(spheres) == 9); }).join();
    std::thread([&] { CHECK(detector.count(spheres) == 9); }).join();
}

// Two threads with one detector: each call succeeds or is refused.
void one_at_a_time() {
    lazygrid::Detector detector(on_cpu());
    const auto spheres = line(5000);
    std::array<bool, 2> right{true, true};
    const auto work = [&](bool &mine) {
        for (int turn = 0; turn < 20; turn++) {
            std::uint64_t count = 7;
            const lazygrid::Query query(spheres);
            const lazygrid_query given = query.get();
            const auto status = lazygrid_count(detector.get(), &given, &count);
            mine = mine && (status == LAZYGRID_OK ? count == 4999 : status == LAZYGRID_ERROR_BUSY && count == 0);
        }
    };
    std::thread one([&] { work(right[0]); }), two([&] { work(right[1]); });
    one.join();
    two.join();
    CHECK(right[0] && right[1]);
}

} // namespace

int main() {
    every_kind_of_input();
    doubles_of_every_layout();
    views_are_ranges();
    errors_are_exceptions();
    streams();
    species_and_boxes();
    two_sets();
    geometry();
    skins();
    boxes_that_lean_and_what_is_left_out();
    moved_from_objects_and_short_lists_are_refused();
    threads();
    one_at_a_time();
    std::cout << passed << " passed, " << failed << " failed" << std::endl;
    return failed != 0;
}
