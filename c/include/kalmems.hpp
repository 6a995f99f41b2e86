// kalmems for C++ 17: the objects of kalmems.h freed where their owner ends, and errors as exceptions. Nothing to link beside the library for C.
#ifndef KALMEMS_HPP
#define KALMEMS_HPP

#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "kalmems.h"

namespace kalmems {

// What went wrong; `what()` says what was found, what was expected, and what to do.
class Error : public std::runtime_error {
  public:
    // Takes an error of the library, and frees it.
    explicit Error(KalmemsError *error)
        : std::runtime_error(text(kalmems_error_message(error))),
          kind(error ? kalmems_error_kind(error) : KALMEMS_ERROR_KIND_DEFECT),
          file(text(kalmems_error_file(error))),
          key(text(kalmems_error_key(error))),
          line(kalmems_error_line(error)) {
        kalmems_error_free(error);
    }

    const KalmemsErrorKind kind;
    // The file that is wrong, and the key of the experiment; empty where it is none.
    const std::string file, key;
    // Counted from 1; 0 where it is none.
    const int line;

  private:
    static std::string text(const char *text) { return text ? text : ""; }
};

namespace detail {

template <auto FREE> struct Freed {
    template <typename T> void operator()(T *object) const { FREE(object); }
};

// Calls a function of the library whose last argument is where its error goes.
template <typename Function, typename... Arguments> auto checked(Function function, Arguments... arguments) {
    KalmemsError *error = nullptr;
    auto result = function(arguments..., &error);
    if (!result) throw Error(error);
    return result;
}

} // namespace detail

// Columns of one length, to be given to an experiment.
class Recording {
  public:
    Recording() : object(kalmems_recording_new()) {}

    // Adds a column; its numbers are copied.
    Recording &add(const std::string &name, const double *numbers, std::size_t count) {
        detail::checked(kalmems_recording_add, object.get(), name.c_str(), numbers, count);
        return *this;
    }

    Recording &add(const std::string &name, const std::vector<double> &numbers) {
        return add(name, numbers.data(), numbers.size());
    }

    // Says what the numbers of a column are in, where its name does not.
    Recording &unit(const std::string &column, const std::string &unit) {
        detail::checked(kalmems_recording_unit, object.get(), column.c_str(), unit.c_str());
        return *this;
    }

    // Says at which rate in Hz the samples were taken.
    Recording &rate(double rate_hz) {
        detail::checked(kalmems_recording_rate, object.get(), rate_hz);
        return *this;
    }

    // Says which column has the times of the samples.
    Recording &clock(const std::string &column) {
        detail::checked(kalmems_recording_clock, object.get(), column.c_str());
        return *this;
    }

    // Says which column tells several records apart.
    Recording &segments(const std::string &column) {
        detail::checked(kalmems_recording_segments, object.get(), column.c_str());
        return *this;
    }

    const KalmemsRecording *get() const { return object.get(); }

  private:
    std::unique_ptr<KalmemsRecording, detail::Freed<kalmems_recording_free>> object;
};

// A column of a trajectory in SI units, valid as long as its estimate.
struct Column {
    std::string name, unit;
    const double *numbers;
    std::size_t count;

    const double *begin() const { return numbers; }
    const double *end() const { return numbers + count; }
    std::size_t size() const { return count; }
    double operator[](std::size_t index) const { return numbers[index]; }
};

// A trajectory of an estimate, valid as long as that.
class Trajectory {
  public:
    Trajectory(const KalmemsEstimate *estimate, std::size_t place) : estimate(estimate), place(place) {}

    std::string name() const { return kalmems_trajectory_name(estimate, place); }
    std::string kind() const { return kalmems_trajectory_kind(estimate, place); }
    std::string recording() const { return kalmems_trajectory_recording(estimate, place); }
    std::string segment() const { return kalmems_trajectory_segment(estimate, place); }
    std::string grade() const { return kalmems_trajectory_grade(estimate, place); }
    bool passes() const { return kalmems_trajectory_passes(estimate, place); }

    std::vector<Column> columns() const {
        std::vector<Column> all;
        for (std::size_t i = 0; i < kalmems_column_count(estimate, place); i++) {
            KalmemsColumn column{};
            column.struct_size = sizeof column;
            detail::checked(kalmems_column, estimate, place, i, &column);
            all.push_back({column.name, column.unit, column.numbers, column.count});
        }
        return all;
    }

    // The column of a name, such as `angle` or `angle_sd`; `std::out_of_range` where there is none.
    Column column(const std::string &name) const {
        for (Column &column : columns()) {
            if (column.name == name) return column;
        }
        throw std::out_of_range("no column is called " + name);
    }

  private:
    const KalmemsEstimate *estimate;
    std::size_t place;
};

// What came of an experiment.
class Estimate {
  public:
    explicit Estimate(KalmemsEstimate *object) : object(object) {}

    std::string metrics() const { return kalmems_estimate_metrics(object.get()); }
    std::string summary() const { return kalmems_estimate_summary(object.get()); }

    // Sentences that a reader must know before trusting a figure.
    std::vector<std::string> notices() const {
        std::vector<std::string> all;
        for (std::size_t i = 0; i < kalmems_estimate_notice_count(object.get()); i++) {
            all.push_back(kalmems_estimate_notice(object.get(), i));
        }
        return all;
    }

    std::vector<Trajectory> trajectories() const {
        std::vector<Trajectory> all;
        for (std::size_t i = 0; i < kalmems_trajectory_count(object.get()); i++) all.emplace_back(object.get(), i);
        return all;
    }

    // The report as a page of HTML.
    std::string report() const {
        std::unique_ptr<char, detail::Freed<kalmems_text_free>> html(detail::checked(kalmems_estimate_report, object.get()));
        return html.get();
    }

    // Writes all of it into a folder, as `kalmems estimate` does.
    void write(const std::string &folder, bool force = false) const {
        detail::checked(kalmems_estimate_write, object.get(), folder.c_str(), force);
    }

  private:
    std::unique_ptr<KalmemsEstimate, detail::Freed<kalmems_estimate_free>> object;
};

// What work other than an estimate has found.
class Findings {
  public:
    explicit Findings(KalmemsFindings *object) : object(object) {}

    // As JSON, with the keys of the file that the command writes.
    std::string json() const { return kalmems_findings_json(object.get()); }
    // As the command prints it.
    std::string text() const { return kalmems_findings_text(object.get()); }
    // The experiment in TOML that follows; empty where none does.
    std::string experiment() const {
        const char *text = kalmems_findings_experiment(object.get());
        return text ? text : "";
    }

    // The columns of a simulated recording, or of the true motion; valid as long as this.
    std::vector<Column> columns(bool of_truth = false) const {
        std::vector<Column> all;
        for (std::size_t i = 0; i < kalmems_findings_column_count(object.get(), of_truth); i++) {
            KalmemsColumn column{};
            column.struct_size = sizeof column;
            detail::checked(kalmems_findings_column, object.get(), of_truth, i, &column);
            all.push_back({column.name, column.unit, column.numbers, column.count});
        }
        return all;
    }

  private:
    std::unique_ptr<KalmemsFindings, detail::Freed<kalmems_findings_free>> object;
};

// A number of an estimate of a stream, such as `angle_rad`.
struct StreamNumber {
    std::string name;
    double value;
};

// An estimate of a stream at a time in s, or with `json` something that happened to it.
struct StreamItem {
    std::string of, json;
    double time_s;
    std::vector<StreamNumber> numbers;

    bool is_estimate() const { return json.empty(); }
};

// Samples that are estimated while they arrive. One thread may push while another polls.
class Stream {
  public:
    explicit Stream(KalmemsStream *object) : object(object) {}

    // Bytes as an instrument sends them.
    void push(const std::string &bytes) {
        detail::checked(kalmems_stream_push, object.get(), reinterpret_cast<const std::uint8_t *>(bytes.data()), bytes.size());
    }

    // Samples, row after row with so many columns.
    void push(const std::vector<double> &rows, std::size_t columns) {
        detail::checked(kalmems_stream_push_rows, object.get(), rows.data(), columns ? rows.size() / columns : 0, columns);
    }

    // Says that no more samples come.
    void close() { kalmems_stream_close(object.get()); }

    // Waits for the next estimate or event no longer than this, in s, and puts it into `item` if there is one.
    KalmemsPoll poll(StreamItem &item, double timeout_s = 0) {
        KalmemsStreamItem found{};
        found.struct_size = sizeof found;
        KalmemsError *error = nullptr;
        const KalmemsPoll polled = kalmems_stream_poll(object.get(), timeout_s, &found, &error);
        if (polled == KALMEMS_POLL_FAILED) throw Error(error);
        if (polled == KALMEMS_POLL_ITEM) {
            item = {found.of, found.json ? found.json : "", found.time_s, {}};
            for (std::size_t i = 0; i < found.count; i++) item.numbers.push_back({found.names[i], found.numbers[i]});
        }
        return polled;
    }

    // What came of it as JSON; empty before a poll has come to its end.
    std::string summary() const {
        const char *text = kalmems_stream_summary(object.get());
        return text ? text : "";
    }

  private:
    std::unique_ptr<KalmemsStream, detail::Freed<kalmems_stream_free>> object;
};

// An experiment with the recordings that were given for it.
class Experiment {
  public:
    // Of a file.
    explicit Experiment(const std::string &path) : object(detail::checked(kalmems_experiment_open, path.c_str())) {}

    // Of a text in TOML, as if it stood at a path.
    Experiment(const std::string &text, const std::string &path)
        : object(detail::checked(kalmems_experiment_parse, text.c_str(), path.c_str())) {}

    // Puts a recording in the place of a file: that of the name or the role `of`, or of the only one.
    Experiment &give(const Recording &recording, const std::string &of = "") {
        detail::checked(kalmems_experiment_give, object.get(), of.empty() ? nullptr : of.c_str(), recording.get());
        return *this;
    }

    Experiment &give_reference(const Recording &recording, const std::string &of = "") {
        detail::checked(kalmems_experiment_give_reference, object.get(), of.empty() ? nullptr : of.c_str(), recording.get());
        return *this;
    }

    // Hears what is done, how much of it and of how much; `false` stops the work. It must not throw.
    using Progress = std::function<bool(const char *what, std::uint64_t done, std::uint64_t total)>;

    Estimate estimate(Progress progress = nullptr) const {
        return Estimate(detail::checked(kalmems_estimate, object.get(), heard(progress), static_cast<void *>(&progress)));
    }

    // Its parameters from its recordings, as `kalmems identify` finds them.
    Findings identify(Progress progress = nullptr) const {
        return Findings(detail::checked(kalmems_identify, object.get(), heard(progress), static_cast<void *>(&progress)));
    }

    // What of it is wrong, as `kalmems diagnose` finds it; by the first filter if none is named.
    Findings diagnose(const std::string &filter = "", bool thorough = false, Progress progress = nullptr) const {
        const char *of = filter.empty() ? nullptr : filter.c_str();
        return Findings(detail::checked(kalmems_diagnose, object.get(), of, thorough, heard(progress), static_cast<void *>(&progress)));
    }

    // The recording that it describes.
    Findings simulate(Progress progress = nullptr) const {
        return Findings(detail::checked(kalmems_simulate, object.get(), heard(progress), static_cast<void *>(&progress)));
    }

    // The source of a filter for a microcontroller in C, or in Rust.
    Findings source(const std::string &filter = "", bool in_rust = false, double rate_hz = 0) const {
        return Findings(detail::checked(kalmems_export, object.get(), filter.empty() ? nullptr : filter.c_str(), in_rust, rate_hz));
    }

    // Estimates of samples while they arrive, which goes on from a file of its state and leaves it there if one is named.
    Stream stream(const std::string &state = "") const {
        return Stream(detail::checked(kalmems_stream_open, object.get(), state.empty() ? nullptr : state.c_str()));
    }

  private:
    static KalmemsProgress heard(const Progress &progress) {
        const KalmemsProgress call = [](const char *what, std::uint64_t done, std::uint64_t total, void *user) {
            return (*static_cast<Progress *>(user))(what, done, total);
        };
        return progress ? call : nullptr;
    }

    std::unique_ptr<KalmemsExperiment, detail::Freed<kalmems_experiment_free>> object;
};

} // namespace kalmems

#endif // KALMEMS_HPP
