/* kalmems for C: motion estimation for MEMS devices with capacitive sensors. Written by cbindgen from src/.
 *
 * Text is UTF-8 that ends with NUL. An object is one that this library has made and that was not freed; it may be used by one thread at a time,
 * different ones by several. A function that fails returns NULL or false, and puts an error to where its last argument points, unless that is
 * NULL; the caller frees it. Texts and columns of an estimate are valid until that is freed.
 */


#ifndef KALMEMS_H
#define KALMEMS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
/* That of this header; `kalmems_version` says that of the library. */
#define KALMEMS_VERSION_MAJOR 0
#define KALMEMS_VERSION_MINOR 1
#define KALMEMS_VERSION_PATCH 0

// What kind of error it is.
typedef enum KalmemsErrorKind {
  // The caller gave something that the function cannot take.
  KALMEMS_ERROR_KIND_ARGUMENT = 1,
  // The experiment is wrong: file, key and line are said.
  KALMEMS_ERROR_KIND_EXPERIMENT = 2,
  // A recording is unusable.
  KALMEMS_ERROR_KIND_RECORDING = 3,
  // Experiment and recording were read, and there is no answer.
  KALMEMS_ERROR_KIND_ESTIMATION = 4,
  // The caller's function of the progress has stopped the work.
  KALMEMS_ERROR_KIND_INTERRUPTED = 5,
  // A defect of this library.
  KALMEMS_ERROR_KIND_DEFECT = 6,
} KalmemsErrorKind;

// What a poll has come to.
typedef enum KalmemsPoll {
  // It failed; the error says why.
  KALMEMS_POLL_FAILED = -1,
  // Nothing is there yet.
  KALMEMS_POLL_NOTHING = 0,
  // There is an item.
  KALMEMS_POLL_ITEM = 1,
  // The stream has ended, and all was polled.
  KALMEMS_POLL_END = 2,
} KalmemsPoll;

// An error, which its reader frees.
typedef struct KalmemsError KalmemsError;

// What came of an experiment.
typedef struct KalmemsEstimate KalmemsEstimate;

// An experiment with the recordings that were given for it.
typedef struct KalmemsExperiment KalmemsExperiment;

// What came of such work.
typedef struct KalmemsFindings KalmemsFindings;

// Columns of one length, to be given to an experiment.
typedef struct KalmemsRecording KalmemsRecording;

// A stream that is being estimated on a thread of its own. One thread may push samples while another polls estimates.
typedef struct KalmemsStream KalmemsStream;

// A function of the caller that hears what is done, how much of it and of how much, with what the caller gave for it; `false` stops the work. It is
// called by the thread that estimates or by one that reads a file, once at a time; it must return, and not call the library with objects of this
// estimate.
typedef bool (*KalmemsProgress)(const char *what, uint64_t done, uint64_t total, void *user);

// A column of a trajectory; its texts and numbers are the estimate's.
typedef struct KalmemsColumn {
  // `sizeof(KalmemsColumn)`, set by the caller: no later version of the library writes more.
  size_t struct_size;
  // What it is: `time`, the name of a state, that with `_sd`, `measured`, `innovation`, `innovation_sd`, `nis`, `log_likelihood`.
  const char *name;
  // The unit of its numbers, in SI.
  const char *unit;
  // Its numbers; what is not known is not a number.
  const double *numbers;
  // How many there are.
  size_t count;
} KalmemsColumn;

// An estimate or an event of a stream; its texts and numbers are valid until the next poll of it.
typedef struct KalmemsStreamItem {
  // `sizeof(KalmemsStreamItem)`, set by the caller: no later version of the library writes more.
  size_t struct_size;
  // The filter as a key, such as `ekf`; `event` or `health` of what happened to the stream or the motion.
  const char *of;
  // What happened as JSON; null of an estimate.
  const char *json;
  // The time of an estimate in s.
  double time_s;
  // The names of its numbers with their units, such as `angle_rad` and `angle_sd_rad`.
  const char *const *names;
  // Its numbers; what is not known is not a number.
  const double *numbers;
  // How many there are.
  size_t count;
} KalmemsStreamItem;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The version of the library.
const char *kalmems_version(void);

// The command `kalmems` with these arguments, of which the first is the name of the program; its exit code. It prints to standard output and standard
// error of the process, sets no handler of signals, and returns 2 for a null pointer and 70 for a defect of the library. One command at a time.
int kalmems_run(int argument_count,
                const char *const *arguments);

// What kind of error it is.
enum KalmemsErrorKind kalmems_error_kind(const struct KalmemsError *error);

// What was found, what was expected, and what to do. The text is the error's.
const char *kalmems_error_message(const struct KalmemsError *error);

// The file that is wrong; null where it is none. The text is the error's.
const char *kalmems_error_file(const struct KalmemsError *error);

// The key of the experiment that is wrong, such as `estimate.filter[0].start`; null where it is none. The text is the error's.
const char *kalmems_error_key(const struct KalmemsError *error);

// The line of the file, counted from 1; 0 where it is none.
int kalmems_error_line(const struct KalmemsError *error);

// Frees an error; null is nothing.
void kalmems_error_free(struct KalmemsError *error);

// Estimates an experiment; null with an error where that cannot be done. `progress` may be null.
struct KalmemsEstimate *kalmems_estimate(const struct KalmemsExperiment *experiment,
                                         KalmemsProgress progress,
                                         void *user,
                                         struct KalmemsError **error);

// All figures, as `metrics.json` has them. The text is the estimate's.
const char *kalmems_estimate_metrics(const struct KalmemsEstimate *estimate);

// The tables that the command prints. The text is the estimate's.
const char *kalmems_estimate_summary(const struct KalmemsEstimate *estimate);

// How many sentences there are that a reader must know before trusting a figure.
size_t kalmems_estimate_notice_count(const struct KalmemsEstimate *estimate);

// One of these sentences; null where there is none. The text is the estimate's.
const char *kalmems_estimate_notice(const struct KalmemsEstimate *estimate, size_t index);

// How many trajectories there are: one for each filter and each segment, and those that are smoothed.
size_t kalmems_trajectory_count(const struct KalmemsEstimate *estimate);

// The name of a trajectory's filter; null where there is none. The text is the estimate's.
const char *kalmems_trajectory_name(const struct KalmemsEstimate *estimate, size_t trajectory);

// What kind of trajectory it is: `model`, `lock_in`, `filtered`, `smoothed`. The text is the estimate's.
const char *kalmems_trajectory_kind(const struct KalmemsEstimate *estimate, size_t trajectory);

// The recording that it is of. The text is the estimate's.
const char *kalmems_trajectory_recording(const struct KalmemsEstimate *estimate, size_t trajectory);

// The segment that it is of. The text is the estimate's.
const char *kalmems_trajectory_segment(const struct KalmemsEstimate *estimate, size_t trajectory);

// Whether its filter makes a claim and no test contradicts it.
bool kalmems_trajectory_passes(const struct KalmemsEstimate *estimate, size_t trajectory);

// How far it can be trusted: `passes`, `passes_with_remarks`, `doubtful`, `failed`, `no_estimate`, or `no_claim` of what makes none. The text is the
// estimate's.
const char *kalmems_trajectory_grade(const struct KalmemsEstimate *estimate,
                                     size_t trajectory);

// How many columns a trajectory has.
size_t kalmems_column_count(const struct KalmemsEstimate *estimate, size_t trajectory);

// A column of a trajectory, put where `column` points; `false` with an error where there is none.
bool kalmems_column(const struct KalmemsEstimate *estimate,
                    size_t trajectory,
                    size_t index,
                    struct KalmemsColumn *column,
                    struct KalmemsError **error);

// The report as a page of HTML, which the caller frees by `kalmems_text_free`; null with an error where it cannot be made.
char *kalmems_estimate_report(const struct KalmemsEstimate *estimate, struct KalmemsError **error);

// Writes all of it into a folder, as `kalmems estimate` does; what is there is replaced if `force` says so or if this library has made it of the
// same experiment.
bool kalmems_estimate_write(const struct KalmemsEstimate *estimate,
                            const char *folder,
                            bool force,
                            struct KalmemsError **error);

// Frees an estimate, and with it all texts and columns that are its own; null is nothing.
void kalmems_estimate_free(struct KalmemsEstimate *estimate);

// The experiment of a file; null with an error where it cannot be read. What is wrong in it is said by the estimate, which reads all of it.
struct KalmemsExperiment *kalmems_experiment_open(const char *path, struct KalmemsError **error);

// The experiment of a text in TOML; `path` is where it stands or would stand, and names of files in it are sought beside that.
struct KalmemsExperiment *kalmems_experiment_parse(const char *text, const char *path, struct KalmemsError **error);

// Puts a recording in the place of the file of a recording of the experiment: that of the name or the role `of`; where `of` is null the only
// one, else the only one of the role `test`.
bool kalmems_experiment_give(struct KalmemsExperiment *experiment,
                             const char *of,
                             const struct KalmemsRecording *recording,
                             struct KalmemsError **error);

// Puts a recording in the place of the file of a reference; which one, as with `kalmems_experiment_give`.
bool kalmems_experiment_give_reference(struct KalmemsExperiment *experiment,
                                       const char *of,
                                       const struct KalmemsRecording *recording,
                                       struct KalmemsError **error);

// Frees an experiment; null is nothing.
void kalmems_experiment_free(struct KalmemsExperiment *experiment);

// Identifies parameters, as `kalmems identify` does; null with an error where that cannot be done. The experiment of the findings has the values.
struct KalmemsFindings *kalmems_identify(const struct KalmemsExperiment *experiment,
                                         KalmemsProgress progress,
                                         void *user,
                                         struct KalmemsError **error);

// Finds what of an experiment is wrong, as `kalmems diagnose` does: by this filter, or the first one if `filter` is null. The experiment of the
// findings is the corrected one; null where no single cause is found.
struct KalmemsFindings *kalmems_diagnose(const struct KalmemsExperiment *experiment,
                                         const char *filter,
                                         bool thorough,
                                         KalmemsProgress progress,
                                         void *user,
                                         struct KalmemsError **error);

// Simulates the recording that the table `simulate` describes. The findings have its columns and those of the true motion; their experiment is that of
// the recording.
struct KalmemsFindings *kalmems_simulate(const struct KalmemsExperiment *experiment,
                                         KalmemsProgress progress,
                                         void *user,
                                         struct KalmemsError **error);

// The source of a filter for a microcontroller, as `kalmems export` writes it: in C, or in Rust if `in_rust` says so; of the first filter that can be
// exported if `filter` is null, and for the sampling rate of the recording if `rate_hz` is 0. The findings' JSON has its files by their names.
struct KalmemsFindings *kalmems_export(const struct KalmemsExperiment *experiment,
                                       const char *filter,
                                       bool in_rust,
                                       double rate_hz,
                                       struct KalmemsError **error);

// Calibrates a gyroscope as the file at this path describes it, as `kalmems calibrate gyro` does.
struct KalmemsFindings *kalmems_calibrate(const char *path, KalmemsProgress progress, void *user, struct KalmemsError **error);

// What was found as JSON, with the keys of the file that the command writes. The text is the findings'.
const char *kalmems_findings_json(const struct KalmemsFindings *findings);

// The same as the command prints it; empty of a simulation and a source. The text is the findings'.
const char *kalmems_findings_text(const struct KalmemsFindings *findings);

// The experiment in TOML that follows; null where none does. The text is the findings'.
const char *kalmems_findings_experiment(const struct KalmemsFindings *findings);

// How many columns a simulation has: of its recording, or of the true motion if `of_truth` says so.
size_t kalmems_findings_column_count(const struct KalmemsFindings *findings, bool of_truth);

// A column of a simulation, put where `column` points; its unit is what its name ends with, and empty here. `false` with an error where there is none.
bool kalmems_findings_column(const struct KalmemsFindings *findings,
                             bool of_truth,
                             size_t index,
                             struct KalmemsColumn *column,
                             struct KalmemsError **error);

// Frees findings, and with them all their texts and columns; null is nothing.
void kalmems_findings_free(struct KalmemsFindings *findings);

// A recording without columns. They are read as those of a file would be: their units are what their names end with (`cap_V`, `time_us`), what
// is not a number is missing, and nothing is repaired.
struct KalmemsRecording *kalmems_recording_new(void);

// Adds a column; its numbers are copied.
bool kalmems_recording_add(struct KalmemsRecording *recording,
                           const char *name,
                           const double *numbers,
                           size_t count,
                           struct KalmemsError **error);

// Says what the numbers of a column are in, where its name does not, or says it wrongly.
bool kalmems_recording_unit(struct KalmemsRecording *recording, const char *column, const char *unit, struct KalmemsError **error);

// Says at which rate in Hz the samples were taken, where that is not for the experiment to say.
bool kalmems_recording_rate(struct KalmemsRecording *recording, double rate_hz, struct KalmemsError **error);

// Says which column has the times of the samples, where that is not for the experiment to say.
bool kalmems_recording_clock(struct KalmemsRecording *recording, const char *column, struct KalmemsError **error);

// Says which column tells several records apart, where that is not for the experiment to say.
bool kalmems_recording_segments(struct KalmemsRecording *recording, const char *column, struct KalmemsError **error);

// Frees a recording, which an experiment that it was given to does not need any more; null is nothing.
void kalmems_recording_free(struct KalmemsRecording *recording);

// Begins to estimate samples as the table `stream` of an experiment says; null with an error where that cannot be. With a file as `state` the stream
// goes on from what an earlier one has left there, and leaves its own; null is none.
struct KalmemsStream *kalmems_stream_open(const struct KalmemsExperiment *experiment,
                                          const char *state,
                                          struct KalmemsError **error);

// Hands bytes over as an instrument sends them, in pieces of any length; waits while 64 pieces wait already. `false` with an error once the stream has
// ended, the reason of which a poll says.
bool kalmems_stream_push(const struct KalmemsStream *stream,
                         const uint8_t *bytes,
                         size_t count,
                         struct KalmemsError **error);

// Hands samples over as numbers, row after row with the columns of `stream.input.text` in their order; what is not a number is missing. Every number
// keeps its last digit.
bool kalmems_stream_push_rows(const struct KalmemsStream *stream,
                              const double *numbers,
                              size_t rows,
                              size_t columns,
                              struct KalmemsError **error);

// Says that no more samples come, after which polls give what is left and then the end. Null is nothing.
void kalmems_stream_close(const struct KalmemsStream *stream);

// The next estimate or event, put where `item` points; waits for it no longer than `timeout_s`.
enum KalmemsPoll kalmems_stream_poll(const struct KalmemsStream *stream,
                                     double timeout_s,
                                     struct KalmemsStreamItem *item,
                                     struct KalmemsError **error);

// What came of the stream as JSON, with counts and health; null before a poll has come to its end. The text is the stream's.
const char *kalmems_stream_summary(const struct KalmemsStream *stream);

// Stops a stream where it is and frees it, with what its items refer to; null is nothing. No other thread may use it any more.
void kalmems_stream_free(struct KalmemsStream *stream);

// Frees a text that a function of this library has returned as the caller's own; null is nothing.
void kalmems_text_free(char *text);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* KALMEMS_H */
