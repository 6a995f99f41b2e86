/* The gateway between MATLAB or Octave and kalmems. The functions of +kalmems call it; nobody else has to.
 *
 *   result  = kalmems_gateway('estimate', experiment, recordings, references, folder, force)
 *   version = kalmems_gateway('version')
 *   html    = kalmems_gateway('report', experiment, recordings, references)
 *   found   = kalmems_gateway('identify' or 'simulate', experiment, recordings, references)
 *   found   = kalmems_gateway('diagnose', experiment, recordings, references, filter, thorough)
 *   found   = kalmems_gateway('export', experiment, recordings, references, filter, in_rust, rate)
 *   found   = kalmems_gateway('calibrate', file)
 *   stream  = kalmems_gateway('stream_open', experiment, state)
 *   kalmems_gateway('stream_push', stream, samples), of a column for each sample, and kalmems_gateway('stream_push', stream, bytes) of uint8
 *   items   = kalmems_gateway('stream_poll', stream, timeout, most)
 *   kalmems_gateway('stream_close' or 'stream_free', stream)
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
static KalmemsFindings *findings;

static void free_all(void) {
    kalmems_estimate_free(estimate);
    kalmems_findings_free(findings);
    findings = NULL;
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

static mxArray *columns_of(bool of_truth) {
    mxArray *made = mxCreateStructMatrix(1, 1, 0, NULL);
    for (size_t i = 0; i < kalmems_findings_column_count(findings, of_truth); i++) {
        KalmemsError *error = NULL;
        KalmemsColumn column = {.struct_size = sizeof column};
        if (!kalmems_findings_column(findings, of_truth, i, &column, &error)) fail(error);
        mxArray *numbers = mxCreateDoubleMatrix(column.count, 1, mxREAL);
        if (column.count) memcpy(mxGetPr(numbers), column.numbers, column.count * sizeof(double));
        mxAddField(made, column.name);
        mxSetField(made, 0, column.name, numbers);
    }
    return made;
}

static mxArray *found(void) {
    static const char *const fields[] = {"json", "text", "experiment", "recording", "truth"};
    mxArray *made = mxCreateStructMatrix(1, 1, sizeof fields / sizeof *fields, (const char **)fields);
    const char *text = kalmems_findings_experiment(findings);
    mxSetField(made, 0, "json", mxCreateString(kalmems_findings_json(findings)));
    mxSetField(made, 0, "text", mxCreateString(kalmems_findings_text(findings)));
    mxSetField(made, 0, "experiment", mxCreateString(text ? text : ""));
    mxSetField(made, 0, "recording", columns_of(false));
    mxSetField(made, 0, "truth", columns_of(true));
    return made;
}

/* Work with an experiment that is opened and given its recordings. */
static void work(const char *what, int nrhs, const mxArray *prhs[]) {
    KalmemsError *error = NULL;
    char *filter = nrhs > 4 ? text_of(prhs[4], "the filter") : NULL;
    const char *of = filter && *filter ? filter : NULL;
    const bool flag = nrhs > 5 && mxGetScalar(prhs[5]) != 0;
    if (!strcmp(what, "identify")) findings = kalmems_identify(experiment, goes_on, NULL, &error);
    else if (!strcmp(what, "simulate")) findings = kalmems_simulate(experiment, goes_on, NULL, &error);
    else if (!strcmp(what, "diagnose")) findings = kalmems_diagnose(experiment, of, flag, goes_on, NULL, &error);
    else findings = kalmems_export(experiment, of, flag, nrhs > 6 ? mxGetScalar(prhs[6]) : 0, &error);
    if (filter) mxFree(filter);
    if (!findings) fail(error);
}

/* Streams by their numbers, which are places here counted from 1. */
#define MOST_STREAMS 64
static KalmemsStream *streams[MOST_STREAMS];

static void free_streams(void) {
    for (size_t i = 0; i < MOST_STREAMS; i++) {
        kalmems_stream_free(streams[i]);
        streams[i] = NULL;
    }
}

static void end(void) {
    free_all();
    free_streams();
}

static KalmemsStream **stream_of(const mxArray *number) {
    const double place = number && mxIsDouble(number) && !mxIsEmpty(number) ? mxGetScalar(number) : 0;
    if (!(place >= 1 && place <= MOST_STREAMS) || !streams[(size_t)place - 1])
        mexErrMsgIdAndTxt("kalmems:argument", "the stream was closed; open another one");
    return &streams[(size_t)place - 1];
}

static mxArray *stream_open(const mxArray *of, const mxArray *state) {
    KalmemsError *error = NULL;
    size_t place = 0;
    while (place < MOST_STREAMS && streams[place]) place++;
    if (place == MOST_STREAMS) mexErrMsgIdAndTxt("kalmems:argument", "%d streams are open; delete one", MOST_STREAMS);
    open_experiment(of);
    char *file = text_of(state, "the file of the state");
    streams[place] = kalmems_stream_open(experiment, *file ? file : NULL, &error);
    mxFree(file);
    if (!streams[place]) fail(error);
    return mxCreateDoubleScalar((double)(place + 1));
}

static void stream_push(KalmemsStream *stream, const mxArray *samples) {
    KalmemsError *error = NULL;
    bool pushed = false;
    if (mxIsDouble(samples) && !mxIsComplex(samples) && !mxIsSparse(samples))
        pushed = kalmems_stream_push_rows(stream, mxGetPr(samples), mxGetN(samples), mxGetM(samples), &error);
    else if (mxIsUint8(samples))
        pushed = kalmems_stream_push(stream, mxGetData(samples), mxGetNumberOfElements(samples), &error);
    else
        mexErrMsgIdAndTxt("kalmems:argument", "samples are a matrix of the class double, or bytes of the class uint8");
    if (!pushed) fail(error);
}

/* Up to so many items; only the first is waited for. */
static mxArray *stream_poll(KalmemsStream *stream, double timeout_s, double most) {
    static const char *const fields[] = {"of", "time", "names", "numbers", "json"};
    mxArray *all = mxCreateCellMatrix(1, 0);
    mwSize count = 0, room = 0;
    KalmemsError *error = NULL;
    KalmemsPoll polled = KALMEMS_POLL_NOTHING;
    while ((double)count < most) {
        KalmemsStreamItem item = {.struct_size = sizeof item};
        polled = kalmems_stream_poll(stream, count ? 0 : timeout_s, &item, &error);
        if (polled != KALMEMS_POLL_ITEM) break;
        if (count == room) {
            room = room ? 2 * room : 64;
            mxArray *more = mxCreateCellMatrix(1, room);
            for (mwIndex i = 0; i < count; i++) {
                mxSetCell(more, i, mxGetCell(all, i));
                mxSetCell(all, i, NULL);
            }
            mxDestroyArray(all);
            all = more;
        }
        mxArray *one = mxCreateStructMatrix(1, 1, sizeof fields / sizeof *fields, (const char **)fields);
        mxArray *names = mxCreateCellMatrix(1, item.count), *numbers = mxCreateDoubleMatrix(1, item.count, mxREAL);
        for (size_t i = 0; i < item.count; i++) mxSetCell(names, i, mxCreateString(item.names[i]));
        if (item.count) memcpy(mxGetPr(numbers), item.numbers, item.count * sizeof(double));
        mxSetField(one, 0, "of", mxCreateString(item.of));
        mxSetField(one, 0, "time", mxCreateDoubleScalar(item.time_s));
        mxSetField(one, 0, "names", names);
        mxSetField(one, 0, "numbers", numbers);
        mxSetField(one, 0, "json", mxCreateString(item.json ? item.json : ""));
        mxSetCell(all, count++, one);
    }
    if (polled == KALMEMS_POLL_FAILED) fail(error);
    static const char *const of_all[] = {"items", "count", "ended", "summary"};
    mxArray *made = mxCreateStructMatrix(1, 1, sizeof of_all / sizeof *of_all, (const char **)of_all);
    const char *summary = kalmems_stream_summary(stream);
    mxSetField(made, 0, "items", all);
    mxSetField(made, 0, "count", mxCreateDoubleScalar((double)count));
    mxSetField(made, 0, "ended", mxCreateLogicalScalar(polled == KALMEMS_POLL_END));
    mxSetField(made, 0, "summary", mxCreateString(summary ? summary : ""));
    return made;
}

static bool streams_do(const char *what, int nrhs, mxArray *plhs[], const mxArray *prhs[]) {
    if (strncmp(what, "stream_", 7)) return false;
    if (!strcmp(what, "stream_open") && nrhs == 3) plhs[0] = stream_open(prhs[1], prhs[2]);
    else if (!strcmp(what, "stream_push") && nrhs == 3) stream_push(*stream_of(prhs[1]), prhs[2]);
    else if (!strcmp(what, "stream_poll") && nrhs == 4)
        plhs[0] = stream_poll(*stream_of(prhs[1]), mxGetScalar(prhs[2]), mxGetScalar(prhs[3]));
    else if (!strcmp(what, "stream_close") && nrhs == 2) kalmems_stream_close(*stream_of(prhs[1]));
    else if (!strcmp(what, "stream_free") && nrhs == 2) {
        KalmemsStream **stream = stream_of(prhs[1]);
        kalmems_stream_free(*stream);
        *stream = NULL;
    } else
        return false;
    free_all();
    return true;
}

/* The name of what is to be done, with as many arguments as it takes. */
static bool takes(const char *what, int nrhs) {
    static const struct {
        const char *name;
        int arguments;
    } all[] = {{"report", 4}, {"estimate", 6}, {"identify", 4}, {"simulate", 4}, {"diagnose", 6}, {"export", 7}, {"calibrate", 2}};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (!strcmp(what, all[i].name)) return nrhs == all[i].arguments;
    return false;
}

void mexFunction(int nlhs, mxArray *plhs[], int nrhs, const mxArray *prhs[]) {
    (void)nlhs;
    /* What an interrupted call has left. */
    free_all();
    mexAtExit(end);
    char what[16] = "";
    if (nrhs < 1 || mxGetString(prhs[0], what, sizeof what)) what[0] = 0;
    if (!strcmp(what, "version")) {
        plhs[0] = mxCreateString(kalmems_version());
        return;
    }
    if (streams_do(what, nrhs, plhs, prhs)) return;
    if (!takes(what, nrhs))
        mexErrMsgIdAndTxt("kalmems:argument", "this gateway is for the functions of +kalmems");
    KalmemsError *error = NULL;
    const bool reports = !strcmp(what, "report");
    if (!strcmp(what, "calibrate")) {
        char *file = text_of(prhs[1], "the file");
        findings = kalmems_calibrate(file, goes_on, NULL, &error);
        mxFree(file);
        if (!findings) fail(error);
        plhs[0] = found();
        free_all();
        return;
    }
    open_experiment(prhs[1]);
    give(prhs[2], false);
    give(prhs[3], true);
    if (!reports && strcmp(what, "estimate")) {
        work(what, nrhs, prhs);
        plhs[0] = found();
        free_all();
        return;
    }
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
