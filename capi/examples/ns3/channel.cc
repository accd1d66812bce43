// Reacting molecules in the event loop of ns-3: a channel that diffuses and reacts at each step, with lazygrid as the
// collision search. A test compares its receiver's counts with lazygrid's simulator in the same scenario.
//
//     lazygrid simulate channel.toml --replicas 64 --output expected
//     run_path=-Wl,-rpath,$(pkg-config --variable=libdir lazygrid)
//     c++ -std=c++17 channel.cc $(pkg-config --cflags --libs lazygrid) $run_path -lns3-core && ./a.out expected/mean.csv 64
//
// Prints both means with their standard errors, and returns 1 if they are more than four of these apart.
#include <lazygrid.hpp>

#include <ns3/core-module.h>
#include <ns3/vector.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

constexpr std::uint32_t acid = 0, base = 1;
// As in channel.toml; lengths in µm.
constexpr double diffusion = 100, release_radius = 1, receiver_radius = 2, receiver_x = 3, base_y = 1;
constexpr double binding_radius = 0.25;
constexpr int time_step = 100, release_of_base = 3000, steps = 120, every = 8; // the first two in µs
constexpr std::uint32_t count_of_each = 1000;

// Points that move at every step; an acid and a base within the binding radius vanish.
class DiffusiveChannel : public ns3::Object {
public:
    static ns3::TypeId GetTypeId() {
        static const ns3::TypeId id =
            ns3::TypeId("DiffusiveChannel")
                .SetParent<ns3::Object>()
                .AddConstructor<DiffusiveChannel>()
                .AddAttribute("TimeStep", "Time between two steps", ns3::TimeValue(ns3::MicroSeconds(time_step)),
                              ns3::MakeTimeAccessor(&DiffusiveChannel::time_step_), ns3::MakeTimeChecker())
                .AddAttribute("Diffusion", "Coefficient of all molecules, in µm²/s", ns3::DoubleValue(diffusion),
                              ns3::MakeDoubleAccessor(&DiffusiveChannel::diffusion_), ns3::MakeDoubleChecker<double>(0))
                .AddTraceSource("Stepped", "A step was done", ns3::MakeTraceSourceAccessor(&DiffusiveChannel::stepped_),
                                "ns3::TracedCallback::Void");
        return id;
    }

    DiffusiveChannel() : detector_(settings()) {}

    // Places molecules anywhere in a ball around (0, y, 0).
    void Release(std::uint32_t species, std::uint32_t count, double y) {
        while (count > 0) {
            const double at[] = {uniform_->GetValue(-1, 1), uniform_->GetValue(-1, 1), uniform_->GetValue(-1, 1)};
            if (at[0] * at[0] + at[1] * at[1] + at[2] * at[2] > 1) continue;
            positions_.emplace_back(release_radius * at[0], release_radius * at[1] + y, release_radius * at[2]);
            species_.push_back(species);
            count--;
        }
    }

    // Schedules the next step.
    void Step() {
        const double length = std::sqrt(2 * diffusion_ * time_step_.GetSeconds());
        for (auto &position : positions_) {
            for (auto *value : {&position.x, &position.y, &position.z}) *value += length * normal_->GetValue();
        }
        React();
        stepped_();
        ns3::Simulator::Schedule(time_step_, &DiffusiveChannel::Step, this);
    }

    // The molecules of a species in the receiver, and in all.
    std::uint32_t Received(std::uint32_t species) const {
        std::uint32_t inside = 0;
        for (std::size_t k = 0; k < positions_.size(); k++) {
            const double x = positions_[k].x - receiver_x, y = positions_[k].y, z = positions_[k].z;
            inside += species_[k] == species && x * x + y * y + z * z <= receiver_radius * receiver_radius;
        }
        return inside;
    }
    std::uint32_t Count(std::uint32_t species) const {
        return static_cast<std::uint32_t>(std::count(species_.begin(), species_.end(), species));
    }

private:
    static lazygrid::Settings settings() {
        // Copied by the constructor of the detector.
        static const auto reactions = [] {
            lazygrid::Interactions table(2, lazygrid::Interaction::never());
            table.set(acid, base, lazygrid::Interaction::within(binding_radius));
            return table;
        }();
        lazygrid::Settings settings;
        settings.backend = lazygrid::Backend::cpu;
        settings.interactions = &reactions;
        return settings;
    }

    // Pairs are in random order, and each molecule reacts once: its first pair wins.
    void React() {
        if (positions_.empty()) return;
        // lazygrid reads ns-3's vectors in place.
        static constexpr double radius = 0;
        const ns3::Vector &first = positions_.front();
        const auto points = lazygrid::Spheres::strided(&first.x, &first.y, &first.z, sizeof first, &radius, 0,
                                                       positions_.size());
        const auto found = detector_.pairs(points.with_species(species_));
        std::vector<lazygrid::Pair> pairs(found.begin(), found.end());
        for (std::size_t k = pairs.size(); k > 1; k--) {
            std::swap(pairs[k - 1], pairs[uniform_->GetInteger(0, static_cast<std::uint32_t>(k - 1))]);
        }
        std::vector<bool> is_gone(positions_.size());
        for (const auto &[i, j] : pairs) {
            if (!is_gone[i] && !is_gone[j]) is_gone[i] = is_gone[j] = true;
        }
        std::size_t left = 0;
        for (std::size_t k = 0; k < positions_.size(); k++) {
            if (is_gone[k]) continue;
            positions_[left] = positions_[k], species_[left++] = species_[k];
        }
        positions_.resize(left);
        species_.resize(left);
    }

    ns3::Time time_step_;
    double diffusion_ = 0;
    ns3::TracedCallback<> stepped_;
    ns3::Ptr<ns3::UniformRandomVariable> uniform_ = ns3::CreateObject<ns3::UniformRandomVariable>();
    ns3::Ptr<ns3::NormalRandomVariable> normal_ = ns3::CreateObject<ns3::NormalRandomVariable>();
    lazygrid::Detector detector_;
    std::vector<ns3::Vector> positions_;
    std::vector<std::uint32_t> species_;
};
NS_OBJECT_ENSURE_REGISTERED(DiffusiveChannel);

// Mean and standard error over several runs.
struct Tally {
    double count = 0, sum = 0, squares = 0;
    void Add(double value) { count++, sum += value, squares += value * value; }
    double Mean() const { return sum / count; }
    double Error() const { return std::sqrt(std::max(0.0, squares - sum * sum / count) / (count - 1) / count); }
};

struct Response {
    std::vector<Tally> received = std::vector<Tally>(steps / every + 1), left = received;
    int step = 0;

    void Sample(const DiffusiveChannel *channel) {
        if (step % every == 0) {
            received[step / every].Add(channel->Received(acid));
            left[step / every].Add(channel->Count(acid));
        }
        step++;
    }
};

void RunOnce(std::uint64_t number, Response &response) {
    ns3::RngSeedManager::SetRun(number);
    const auto channel = ns3::CreateObject<DiffusiveChannel>();
    const auto sample = ns3::MakeCallback(&Response::Sample, &response).Bind(ns3::PeekPointer(channel));
    channel->TraceConnectWithoutContext("Stepped", sample);
    response.step = 0;
    channel->Release(acid, count_of_each, 0);
    sample();
    // A step at the same time would run after events that were scheduled before it.
    const auto after = ns3::MicroSeconds(release_of_base + time_step / 2);
    ns3::Simulator::Schedule(after, &DiffusiveChannel::Release, channel, base, count_of_each, base_y);
    ns3::Simulator::Schedule(ns3::MicroSeconds(time_step), &DiffusiveChannel::Step, channel);
    ns3::Simulator::Stop(ns3::MicroSeconds(time_step * steps + time_step / 2));
    ns3::Simulator::Run();
    ns3::Simulator::Destroy();
}

// The rows of a CSV file, by column name.
std::vector<std::map<std::string, double>> Read(const std::string &path) {
    std::ifstream file(path);
    std::string line, cell;
    std::vector<std::string> names;
    std::vector<std::map<std::string, double>> rows;
    if (!std::getline(file, line)) throw std::runtime_error(path + " cannot be read");
    for (std::istringstream cells(line); std::getline(cells, cell, ',');) names.push_back(cell);
    while (std::getline(file, line)) {
        auto &row = rows.emplace_back();
        std::size_t column = 0;
        for (std::istringstream cells(line); std::getline(cells, cell, ',');) row[names.at(column++)] = std::stod(cell);
    }
    return rows;
}

// Returns true if two means are within four standard errors of their difference.
bool Same(const Tally &own, const std::map<std::string, double> &row, const std::string &name) {
    const double mean = row.at(name + " mean"), error = row.at(name + " error");
    const double apart = std::abs(own.Mean() - mean), allowed = 4 * std::hypot(own.Error(), error);
    std::printf("  %8.2f ± %5.2f  %8.2f ± %5.2f %s", own.Mean(), own.Error(), mean, error, apart <= allowed ? " " : "!");
    return apart <= allowed;
}

int Compare(const char *path, int runs) {
    const auto expected = Read(path);
    Response response;
    for (int run = 1; run <= runs; run++) RunOnce(static_cast<std::uint64_t>(run), response);
    if (expected.size() != response.received.size()) throw std::runtime_error(std::string(path) + " is of another scenario");
    std::printf("of %u acids  in the receiver: ns-3, simulator      not neutralized: ns-3, simulator\n", count_of_each);
    bool is_same = true;
    for (std::size_t k = 0; k < expected.size(); k++) {
        std::printf("%8.1f ms", 1e-3 * time_step * every * static_cast<double>(k));
        is_same &= Same(response.received[k], expected[k], "rx:acid");
        is_same &= Same(response.left[k], expected[k], "acid");
        std::printf("\n");
    }
    std::printf(is_same ? "the same within four standard errors\n" : "not the same\n");
    return is_same ? 0 : 1;
}

} // namespace

int main(int count, char **arguments) {
    if (count != 3 || std::atoi(arguments[2]) < 2) {
        std::fprintf(stderr, "give the simulator's mean.csv, and how many runs to make, 2 or more\n");
        return 2;
    }
    try {
        return Compare(arguments[1], std::atoi(arguments[2]));
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 2;
    }
}
