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

// An error, which its reader frees.
typedef struct KalmemsError KalmemsError;

// What came of an experiment.
typedef struct KalmemsEstimate KalmemsEstimate;

// An experiment with the recordings that were given for it.
typedef struct KalmemsExperiment KalmemsExperiment;

// Columns of one length, to be given to an experiment.
typedef struct KalmemsRecording KalmemsRecording;

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

// Frees a text that a function of this library has returned as the caller's own; null is nothing.
void kalmems_text_free(char *text);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* KALMEMS_H */
