/* The gateway between MATLAB or Octave and kalmems. The functions of +kalmems call it; nobody else has to.
 *
 *   result  = kalmems_gateway('estimate', experiment, recordings, references, folder, force)
 *   version = kalmems_gateway('version')
 *   html    = kalmems_gateway('report', experiment, recordings, references)
 *
 * experiment: the path of a file, or a structure with the fields path and text.
 * recordings, references: structure arrays with the fields of (a name, or ''), names (cell), columns (cell of double), units (cell of name and
 * unit in turn), segments (a name, or ''), clock (a name, or ''), rate (in Hz, or NaN).
 * folder: where the estimate is written as well, or ''.
 */
#include <math.h>
#include <stdio.h>
#include <stdbool.h>
#include <string.h>

#include "kalmems.h"
#include "mex.h"

#ifdef OCTAVE_MEX
/* Octave has no public function that says whether Ctrl-C was pressed: it ends the call itself. */
static bool interrupted(void) { return false; }
#else
bool utIsInterruptPending(void);
static bool interrupted(void) { return utIsInterruptPending(); }
#endif

static bool goes_on(const char *what, uint64_t done, uint64_t total, void *user) {
    (void)what;
    (void)done;
    (void)total;
    (void)user;
    return !interrupted();
}

/* What is held while a call lasts, and freed before an error leaves it. */
static KalmemsExperiment *experiment;
static KalmemsRecording *recording;
static KalmemsEstimate *estimate;

static void free_all(void) {
    kalmems_estimate_free(estimate);
    kalmems_recording_free(recording);
    kalmems_experiment_free(experiment);
    estimate = NULL;
    recording = NULL;
    experiment = NULL;
}

static void fail(KalmemsError *error) {
    static char message[8192];
    static const char *const kinds[] = {"", "argument", "experiment", "recording", "estimation", "interrupted", "defect"};
    char identifier[32];
    const unsigned kind = (unsigned)kalmems_error_kind(error);
    const char *text = kalmems_error_message(error);
    strncpy(message, text ? text : "no message", sizeof message - 1);
    snprintf(identifier, sizeof identifier, "kalmems:%s", kinds[kind < 7 ? kind : 0]);
    kalmems_error_free(error);
    free_all();
    mexErrMsgIdAndTxt(identifier, "%s", message);
}

static char *text_of(const mxArray *value, const char *what) {
    char *text = value && mxIsChar(value) ? mxArrayToString(value) : NULL;
    if (!text) {
        free_all();
        mexErrMsgIdAndTxt("kalmems:argument", "%s: text is expected", what);
    }
    return text;
}

static const mxArray *field(const mxArray *structure, mwIndex index, const char *name) {
    const mxArray *value = mxGetField(structure, index, name);
    if (!value) {
        free_all();
        mexErrMsgIdAndTxt("kalmems:argument", "the field %s is missing", name);
    }
    return value;
}

static void open_experiment(const mxArray *given) {
    KalmemsError *error = NULL;
    if (mxIsStruct(given)) {
        char *path = text_of(field(given, 0, "path"), "path"), *text = text_of(field(given, 0, "text"), "text");
        experiment = kalmems_experiment_parse(text, path, &error);
        mxFree(path);
        mxFree(text);
    } else {
        char *path = text_of(given, "the experiment");
        experiment = kalmems_experiment_open(path, &error);
        mxFree(path);
    }
    if (!experiment) fail(error);
}

static void give(const mxArray *all, bool as_references) {
    KalmemsError *error = NULL;
    const mwSize count = all && mxIsStruct(all) ? mxGetNumberOfElements(all) : 0;
    for (mwIndex k = 0; k < count; k++) {
        const mxArray *names = field(all, k, "names"), *columns = field(all, k, "columns"), *units = field(all, k, "units");
        recording = kalmems_recording_new();
        for (mwIndex i = 0; i < mxGetNumberOfElements(names); i++) {
            char *name = text_of(mxGetCell(names, i), "the name of a column");
            const mxArray *column = mxGetCell(columns, i);
            if (!column || !mxIsDouble(column) || mxIsComplex(column) || mxIsSparse(column)) {
                free_all();
                mexErrMsgIdAndTxt("kalmems:argument", "%s: real numbers of the class double are expected", name);
            }
            const bool added = kalmems_recording_add(recording, name, mxGetPr(column), mxGetNumberOfElements(column), &error);
            mxFree(name);
            if (!added) fail(error);
        }
        for (mwIndex i = 0; i + 1 < mxGetNumberOfElements(units); i += 2) {
            char *column = text_of(mxGetCell(units, i), "the name of a column"), *unit = text_of(mxGetCell(units, i + 1), "a unit");
            const bool told = kalmems_recording_unit(recording, column, unit, &error);
            mxFree(column);
            mxFree(unit);
            if (!told) fail(error);
        }
        char *of = text_of(field(all, k, "of"), "of"), *segments = text_of(field(all, k, "segments"), "segments"),
             *clock = text_of(field(all, k, "clock"), "clock");
        const double rate = mxGetScalar(field(all, k, "rate"));
        bool fine = true;
        if (*segments) fine = kalmems_recording_segments(recording, segments, &error);
        if (fine && *clock) fine = kalmems_recording_clock(recording, clock, &error);
        if (fine && !isnan(rate)) fine = kalmems_recording_rate(recording, rate, &error);
        if (fine)
            fine = (as_references ? kalmems_experiment_give_reference : kalmems_experiment_give)(
                experiment, *of ? of : NULL, recording, &error);
        mxFree(of);
        mxFree(segments);
        mxFree(clock);
        if (!fine) fail(error);
        kalmems_recording_free(recording);
        recording = NULL;
    }
}

static mxArray *trajectories(void) {
    static const char *const fields[] = {"name", "kind", "recording", "segment", "passes", "grade", "names", "units", "columns"};
    const size_t count = kalmems_trajectory_count(estimate);
    mxArray *all = mxCreateStructMatrix(count, 1, sizeof fields / sizeof *fields, (const char **)fields);
    for (size_t k = 0; k < count; k++) {
        const size_t width = kalmems_column_count(estimate, k);
        mxArray *names = mxCreateCellMatrix(1, width), *units = mxCreateCellMatrix(1, width), *columns = mxCreateCellMatrix(1, width);
        for (size_t i = 0; i < width; i++) {
            KalmemsError *error = NULL;
            KalmemsColumn column = {.struct_size = sizeof column};
            if (!kalmems_column(estimate, k, i, &column, &error)) fail(error);
            mxArray *numbers = mxCreateDoubleMatrix(column.count, 1, mxREAL);
            if (column.count) memcpy(mxGetPr(numbers), column.numbers, column.count * sizeof(double));
            mxSetCell(names, i, mxCreateString(column.name));
            mxSetCell(units, i, mxCreateString(column.unit));
            mxSetCell(columns, i, numbers);
        }
        mxSetField(all, k, "name", mxCreateString(kalmems_trajectory_name(estimate, k)));
        mxSetField(all, k, "kind", mxCreateString(kalmems_trajectory_kind(estimate, k)));
        mxSetField(all, k, "recording", mxCreateString(kalmems_trajectory_recording(estimate, k)));
        mxSetField(all, k, "segment", mxCreateString(kalmems_trajectory_segment(estimate, k)));
        mxSetField(all, k, "passes", mxCreateLogicalScalar(kalmems_trajectory_passes(estimate, k)));
        mxSetField(all, k, "grade", mxCreateString(kalmems_trajectory_grade(estimate, k)));
        mxSetField(all, k, "names", names);
        mxSetField(all, k, "units", units);
        mxSetField(all, k, "columns", columns);
    }
    return all;
}

static mxArray *result(void) {
    static const char *const fields[] = {"metrics", "summary", "notices", "trajectories"};
    mxArray *made = mxCreateStructMatrix(1, 1, sizeof fields / sizeof *fields, (const char **)fields);
    const size_t count = kalmems_estimate_notice_count(estimate);
    mxArray *notices = mxCreateCellMatrix(count, 1);
    for (size_t k = 0; k < count; k++) mxSetCell(notices, k, mxCreateString(kalmems_estimate_notice(estimate, k)));
    mxSetField(made, 0, "metrics", mxCreateString(kalmems_estimate_metrics(estimate)));
    mxSetField(made, 0, "summary", mxCreateString(kalmems_estimate_summary(estimate)));
    mxSetField(made, 0, "notices", notices);
    mxSetField(made, 0, "trajectories", trajectories());
    return made;
}

void mexFunction(int nlhs, mxArray *plhs[], int nrhs, const mxArray *prhs[]) {
    (void)nlhs;
    /* What an interrupted call has left. */
    free_all();
    mexAtExit(free_all);
    char *what = text_of(nrhs > 0 ? prhs[0] : NULL, "what to do");
    if (!strcmp(what, "version")) {
        mxFree(what);
        plhs[0] = mxCreateString(kalmems_version());
        return;
    }
    const bool reports = !strcmp(what, "report"), estimates = !strcmp(what, "estimate");
    mxFree(what);
    if (!(reports && nrhs == 4) && !(estimates && nrhs == 6))
        mexErrMsgIdAndTxt("kalmems:argument", "this gateway is for the functions of +kalmems");
    KalmemsError *error = NULL;
    open_experiment(prhs[1]);
    give(prhs[2], false);
    give(prhs[3], true);
    estimate = kalmems_estimate(experiment, goes_on, NULL, &error);
    if (!estimate) fail(error);
    if (reports) {
        char *html = kalmems_estimate_report(estimate, &error);
        if (!html) fail(error);
        plhs[0] = mxCreateString(html);
        kalmems_text_free(html);
    } else {
        char *folder = text_of(prhs[4], "the folder");
        const bool done = !*folder || kalmems_estimate_write(estimate, folder, mxGetScalar(prhs[5]) != 0, &error);
        mxFree(folder);
        if (!done) fail(error);
        plhs[0] = result();
    }
    free_all();
}
