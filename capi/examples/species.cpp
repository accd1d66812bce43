// Acid and base in a periodic box: an acid and a base within their binding radius react and vanish.
//
//     run_path=-Wl,-rpath,$(pkg-config --variable=libdir lazygrid)
//     c++ -std=c++17 species.cpp $(pkg-config --cflags --libs lazygrid) $run_path && ./a.out
#include <lazygrid.hpp>

#include <cstdint>
#include <exception>
#include <iostream>
#include <random>
#include <vector>

namespace {

constexpr float edge = 10, step_length = 0.05f, binding_radius = 0.2f;
constexpr std::uint32_t acid = 0, base = 1;

// Columns, as in many simulators; points have radius 0.
struct Molecules {
    std::vector<float> x, y, z, r;
    std::vector<std::uint32_t> species;

    void add(float at_x, float at_y, float at_z, std::uint32_t of) {
        x.push_back(at_x), y.push_back(at_y), z.push_back(at_z), r.push_back(0), species.push_back(of);
    }
};

Molecules survivors(const Molecules &all, const std::vector<bool> &is_used) {
    Molecules left;
    for (std::size_t k = 0; k < all.x.size(); k++) {
        if (!is_used[k]) left.add(all.x[k], all.y[k], all.z[k], all.species[k]);
    }
    return left;
}

void run() {
    std::mt19937 random(1);
    std::uniform_real_distribution<float> anywhere(0, edge);
    std::normal_distribution<float> diffusion(0, step_length);
    Molecules molecules;
    for (int k = 0; k < 4000; k++) {
        const float x = anywhere(random), y = anywhere(random), z = anywhere(random);
        molecules.add(x, y, z, k % 2 == 0 ? acid : base);
    }

    lazygrid::Interactions reactions(2, lazygrid::Interaction::never());
    reactions.set(acid, base, lazygrid::Interaction::within(binding_radius));
    lazygrid::Settings settings;
    settings.interactions = &reactions;
    settings.periodic = {edge, edge, edge};
    lazygrid::Detector detector(settings);

    for (int step = 0; step < 10; step++) {
        const auto spheres = lazygrid::Spheres::columns(molecules.x, molecules.y, molecules.z, molecules.r);
        std::vector<bool> is_used(molecules.x.size());
        // In canonical order the first pair of a molecule wins, so runs are reproducible.
        for (const auto &[i, j] : detector.pairs(spheres.with_species(molecules.species))) {
            if (!is_used[i] && !is_used[j]) is_used[i] = is_used[j] = true;
        }
        molecules = survivors(molecules, is_used);
        for (auto *column : {&molecules.x, &molecules.y, &molecules.z}) {
            for (auto &value : *column) value += diffusion(random);
        }
        std::cout << "step " << step << ": " << molecules.x.size() << " molecules left\n";
    }
    std::cout << detector.report_json() << '\n';
}

} // namespace

int main() {
    try {
        run();
    } catch (const std::exception &error) {
        std::cerr << error.what() << '\n';
        return 1;
    }
}
