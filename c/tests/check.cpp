// What a program in C++ sees of the library: the numbers of a file as arrays, errors as exceptions, and a stop.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "kalmems.hpp"

static void require(bool condition, const char *what) {
    if (!condition) {
        std::fprintf(stderr, "not so: %s\n", what);
        std::exit(1);
    }
}
#define REQUIRE(condition) require(condition, #condition)

static kalmems::Recording read_csv(const char *path) {
    std::ifstream file(path);
    std::vector<std::string> names;
    std::vector<std::vector<double>> columns;
    for (std::string line; std::getline(file, line);) {
        if (line.rfind("#", 0) == 0) continue;
        std::stringstream cells(line);
        std::size_t column = 0;
        const bool is_head = names.empty();
        for (std::string cell; std::getline(cells, cell, ','); column++) {
            if (is_head) {
                names.push_back(cell);
                columns.emplace_back();
            } else {
                columns[column].push_back(std::strtod(cell.c_str(), nullptr));
            }
        }
    }
    kalmems::Recording recording;
    for (std::size_t i = 0; i < names.size(); i++) recording.add(names[i], columns[i]);
    return recording;
}

int main(int argc, char **argv) {
    REQUIRE(argc == 3);
    kalmems::Experiment experiment(argv[1]);
    const kalmems::Estimate of_file = experiment.estimate();
    const kalmems::Estimate of_arrays = experiment.give(read_csv(argv[2])).estimate();
    const auto files = of_file.trajectories(), arrays = of_arrays.trajectories();
    REQUIRE(files.size() == arrays.size() && files.size() > 1);
    std::size_t compared = 0;
    for (std::size_t k = 0; k < files.size(); k++) {
        REQUIRE(files[k].name() == arrays[k].name() && files[k].grade() == arrays[k].grade());
        const kalmems::Column angle = files[k].column("angle"), again = arrays[k].column("angle");
        REQUIRE(angle.unit == "rad" && angle.size() == again.size());
        for (std::size_t i = 0; i < angle.size(); i++) compared += angle[i] == again[i] || std::isnan(angle[i]);
    }
    REQUIRE(compared == files.size() * files[0].column("angle").size());
    REQUIRE(!of_arrays.notices().empty() && of_arrays.summary().find("EKF") != std::string::npos);
    REQUIRE(of_arrays.report().find("<html") != std::string::npos);
    try {
        files[0].column("angel");
        REQUIRE(false);
    } catch (const std::out_of_range &) {
    }
    int heard = 0;
    try {
        experiment.estimate([&heard](const char *, std::uint64_t, std::uint64_t) { return ++heard < 0; });
        REQUIRE(false);
    } catch (const kalmems::Error &error) {
        REQUIRE(heard > 0 && error.kind == KALMEMS_ERROR_KIND_INTERRUPTED);
    }
    try {
        kalmems::Experiment("name = \"x\"\ndecription = \"y\"\n", "wrong.toml").estimate();
        REQUIRE(false);
    } catch (const kalmems::Error &error) {
        REQUIRE(error.kind == KALMEMS_ERROR_KIND_EXPERIMENT && error.file == "wrong.toml" && error.line == 2);
        REQUIRE(std::string(error.what()).find("did you mean `description`") != std::string::npos);
    }
    const std::string folder = std::string(argv[1]).substr(0, std::string(argv[1]).find_last_of('/') + 1);
    const kalmems::Findings simulated = kalmems::Experiment(folder + "simulation.toml").simulate();
    REQUIRE(simulated.columns().size() == 3 && simulated.columns(true)[1].name == "angle_rad" && simulated.experiment().size() > 100);
    REQUIRE(experiment.source().json().find(".h\":") != std::string::npos);
    kalmems::Stream stream = kalmems::Experiment(folder + "stream.toml").stream();
    std::ifstream file(argv[2]);
    std::stringstream all;
    all << file.rdbuf();
    stream.push(all.str());
    stream.close();
    kalmems::StreamItem item{};
    std::size_t estimates = 0;
    for (KalmemsPoll polled; (polled = stream.poll(item, 10)) != KALMEMS_POLL_END;) {
        if (polled == KALMEMS_POLL_ITEM && item.is_estimate()) estimates += item.numbers[0].name == "angle_rad";
    }
    REQUIRE(estimates > 4000 && stream.summary().find("estimated") != std::string::npos);
    std::puts("the wrapper does for C++ what the library does for C");
}
