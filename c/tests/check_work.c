/* What a program in C sees of streams and of other work than estimates: check_work EXPERIMENTS_FOLDER, the examples of the scanner. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kalmems.h"

#define REQUIRE(condition)                                                          \
    do {                                                                            \
        if (!(condition)) {                                                         \
            fprintf(stderr, "%s:%d: not so: %s\n", __FILE__, __LINE__, #condition); \
            exit(1);                                                                \
        }                                                                           \
    } while (0)

static KalmemsError *error;
static char path[2048];

static const char *of(const char *folder, const char *file) {
    snprintf(path, sizeof path, "%s/%s", folder, file);
    return path;
}

static KalmemsExperiment *opened(const char *folder, const char *file) {
    KalmemsExperiment *experiment = kalmems_experiment_open(of(folder, file), &error);
    REQUIRE(experiment && !error);
    return experiment;
}

static void expect(KalmemsErrorKind kind, const char *part) {
    REQUIRE(error && kalmems_error_kind(error) == kind && strstr(kalmems_error_message(error), part));
    kalmems_error_free(error);
    error = NULL;
}

/* The bytes of a file, which the caller frees. */
static char *contents(const char *file, size_t *size) {
    FILE *opened_file = fopen(file, "rb");
    REQUIRE(opened_file && !fseek(opened_file, 0, SEEK_END));
    *size = (size_t)ftell(opened_file);
    rewind(opened_file);
    char *bytes = malloc(*size + 1);
    REQUIRE(bytes && fread(bytes, 1, *size, opened_file) == *size);
    bytes[*size] = 0;
    fclose(opened_file);
    return bytes;
}

/* What a stream says: how many estimates and events, and the first filter's last angle with its time. */
typedef struct Heard {
    size_t estimates, events, health;
    double time_s, angle;
} Heard;

static KalmemsPoll polled(KalmemsStream *stream, double timeout_s, Heard *heard) {
    KalmemsStreamItem item = {.struct_size = sizeof item};
    const KalmemsPoll found = kalmems_stream_poll(stream, timeout_s, &item, &error);
    if (found != KALMEMS_POLL_ITEM) return found;
    if (item.json) {
        REQUIRE(item.json[0] == '{' && (!strcmp(item.of, "event") || !strcmp(item.of, "health")));
        if (!strcmp(item.of, "event")) heard->events++;
        else heard->health++;
        return found;
    }
    REQUIRE(item.count > 1 && !strcmp(item.names[0], "angle_rad") && !strcmp(item.names[1], "angle_sd_rad"));
    if (!strcmp(item.of, "ekf")) {
        heard->estimates++;
        heard->time_s = item.time_s;
        heard->angle = item.numbers[0];
    }
    return found;
}

static Heard streamed(KalmemsExperiment *experiment, const char *bytes, size_t size) {
    Heard heard = {0};
    KalmemsStream *stream = kalmems_stream_open(experiment, NULL, &error);
    REQUIRE(stream && !error);
    KalmemsPoll found = KALMEMS_POLL_NOTHING;
    for (size_t sent = 0; sent < size; sent += 4096) {
        const size_t count = size - sent < 4096 ? size - sent : 4096;
        REQUIRE(kalmems_stream_push(stream, (const uint8_t *)bytes + sent, count, &error));
        while ((found = polled(stream, 0, &heard)) == KALMEMS_POLL_ITEM) {}
        REQUIRE(found == KALMEMS_POLL_NOTHING && !kalmems_stream_summary(stream));
    }
    kalmems_stream_close(stream);
    while ((found = polled(stream, 10, &heard)) == KALMEMS_POLL_ITEM || found == KALMEMS_POLL_NOTHING) {}
    REQUIRE(found == KALMEMS_POLL_END && strstr(kalmems_stream_summary(stream), "\"estimated\":24001"));
    REQUIRE(polled(stream, 0, &heard) == KALMEMS_POLL_END);
    REQUIRE(!kalmems_stream_push(stream, (const uint8_t *)"1\n", 2, &error));
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "takes no samples any more");
    kalmems_stream_free(stream);
    return heard;
}

/* Bytes that a thread of its own pushes. */
typedef struct Pushed {
    KalmemsStream *stream;
    const char *bytes;
    size_t size;
} Pushed;

static void *push_all(void *given) {
    const Pushed *all = given;
    for (size_t sent = 0; sent < all->size; sent += 1000) {
        const size_t count = all->size - sent < 1000 ? all->size - sent : 1000;
        REQUIRE(kalmems_stream_push(all->stream, (const uint8_t *)all->bytes + sent, count, NULL));
    }
    kalmems_stream_close(all->stream);
    return NULL;
}

static void check_threads(KalmemsExperiment *experiment, const char *bytes, size_t size, Heard expected) {
    Heard heard = {0};
    Pushed all = {kalmems_stream_open(experiment, NULL, &error), bytes, size};
    REQUIRE(all.stream);
    pthread_t pusher;
    REQUIRE(!pthread_create(&pusher, NULL, push_all, &all));
    KalmemsPoll found;
    while ((found = polled(all.stream, 10, &heard)) == KALMEMS_POLL_ITEM || found == KALMEMS_POLL_NOTHING) {}
    REQUIRE(found == KALMEMS_POLL_END && heard.estimates == expected.estimates && heard.angle == expected.angle);
    REQUIRE(!pthread_join(pusher, NULL));
    kalmems_stream_free(all.stream);
}

static void check_streams(const char *folder) {
    size_t size;
    char *bytes = contents(of(folder, "recording.csv"), &size);
    KalmemsExperiment *experiment = opened(folder, "stream.toml");
    const Heard heard = streamed(experiment, bytes, size);
    REQUIRE(heard.estimates == 2401 && heard.events > 0 && fabs(heard.time_s - 0.024) < 1e-9 && fabs(heard.angle) < 0.3);

    check_threads(experiment, bytes, size, heard);

    /* The same samples as numbers. */
    KalmemsStream *stream = kalmems_stream_open(experiment, NULL, &error);
    REQUIRE(stream);
    double row[3] = {0, 1, 2};
    REQUIRE(!kalmems_stream_push_rows(stream, row, 1, 2, &error));
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "2 columns; the stream consists of 3");
    REQUIRE(!kalmems_stream_push_rows(stream, NULL, 1, 3, &error));
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "null");
    Heard numbers = {0};
    char *line = strchr(bytes, '\n');
    for (; line && line[1]; line = strchr(line + 1, '\n')) {
        REQUIRE(sscanf(line + 1, "%lf,%lf,%lf", &row[0], &row[1], &row[2]) == 3);
        REQUIRE(kalmems_stream_push_rows(stream, row, 1, 3, &error));
    }
    kalmems_stream_close(stream);
    KalmemsPoll found;
    while ((found = polled(stream, 10, &numbers)) == KALMEMS_POLL_ITEM || found == KALMEMS_POLL_NOTHING) {}
    REQUIRE(found == KALMEMS_POLL_END && numbers.estimates == heard.estimates && numbers.angle == heard.angle);
    kalmems_stream_free(stream);

    /* One that is stopped on the way, and what cannot be. */
    stream = kalmems_stream_open(experiment, NULL, &error);
    REQUIRE(stream && kalmems_stream_push(stream, (const uint8_t *)bytes, size / 2, &error));
    kalmems_stream_free(stream);
    KalmemsStreamItem unset = {.struct_size = 0};
    REQUIRE(kalmems_stream_poll(NULL, 0, &unset, &error) == KALMEMS_POLL_FAILED);
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "null");
    REQUIRE(!kalmems_stream_open(NULL, NULL, &error));
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "null");
    kalmems_stream_free(NULL);
    KalmemsExperiment *without = opened(folder, "experiment.toml");
    stream = kalmems_stream_open(without, NULL, &error);
    REQUIRE(stream);
    REQUIRE(kalmems_stream_poll(stream, 10, &unset, &error) == KALMEMS_POLL_FAILED);
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "struct_size");
    while ((found = polled(stream, 10, &numbers)) == KALMEMS_POLL_NOTHING) {}
    REQUIRE(found == KALMEMS_POLL_FAILED);
    expect(KALMEMS_ERROR_KIND_EXPERIMENT, "[stream]");
    kalmems_stream_free(stream);
    kalmems_experiment_free(without);
    kalmems_experiment_free(experiment);
    free(bytes);
}

static void check_findings(const char *folder) {
    KalmemsExperiment *ring_down = opened(folder, "ring_down.toml");
    KalmemsFindings *identified = kalmems_identify(ring_down, NULL, NULL, &error);
    REQUIRE(identified && strstr(kalmems_findings_json(identified), "\"parameters\"") && *kalmems_findings_text(identified));
    const char *text = kalmems_findings_experiment(identified);
    REQUIRE(text && strstr(text, "stiffness"));
    /* What was identified is an experiment. */
    KalmemsExperiment *again = kalmems_experiment_parse(text, of(folder, "identified.toml"), &error);
    REQUIRE(again);
    kalmems_experiment_free(again);
    kalmems_findings_free(identified);
    kalmems_experiment_free(ring_down);

    KalmemsExperiment *simulation = opened(folder, "simulation.toml");
    KalmemsFindings *simulated = kalmems_simulate(simulation, NULL, NULL, &error);
    REQUIRE(simulated && kalmems_findings_column_count(simulated, false) == 3 && kalmems_findings_column_count(simulated, true) > 1);
    KalmemsColumn column = {.struct_size = sizeof column};
    REQUIRE(kalmems_findings_column(simulated, false, 0, &column, &error) && !strcmp(column.name, "time_s") && column.count == 60001);
    REQUIRE(kalmems_findings_column(simulated, true, 1, &column, &error) && !strcmp(column.name, "angle_rad") && column.numbers[0] == 1e-4);
    REQUIRE(!kalmems_findings_column(simulated, true, 99, &column, &error));
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "there is no column 99");
    kalmems_findings_free(simulated);
    REQUIRE(!kalmems_identify(simulation, NULL, NULL, &error));
    expect(KALMEMS_ERROR_KIND_EXPERIMENT, "[identify]");
    kalmems_experiment_free(simulation);

    KalmemsExperiment *experiment = opened(folder, "experiment.toml");
    KalmemsFindings *source = kalmems_export(experiment, NULL, false, 0, &error);
    REQUIRE(source && strstr(kalmems_findings_json(source), ".h\":") && !kalmems_findings_experiment(source));
    kalmems_findings_free(source);
    REQUIRE(!kalmems_export(experiment, "LKF", false, 0, &error));
    expect(KALMEMS_ERROR_KIND_ESTIMATION, "there is no filter `LKF`");
    REQUIRE(!kalmems_export(experiment, NULL, false, -1, &error));
    expect(KALMEMS_ERROR_KIND_ARGUMENT, "Hz");
    KalmemsFindings *diagnosed = kalmems_diagnose(experiment, NULL, false, NULL, NULL, &error);
    REQUIRE(diagnosed && strstr(kalmems_findings_json(diagnosed), "\"causes\""));
    kalmems_findings_free(diagnosed);
    kalmems_experiment_free(experiment);

    KalmemsFindings *calibrated = kalmems_calibrate(of(folder, "../gyroscope/calibration.toml"), NULL, NULL, &error);
    REQUIRE(calibrated && *kalmems_findings_text(calibrated));
    kalmems_findings_free(calibrated);
    REQUIRE(!kalmems_calibrate(of(folder, "image.toml"), NULL, NULL, &error));
    expect(KALMEMS_ERROR_KIND_EXPERIMENT, "gyroscope");
    REQUIRE(!kalmems_findings_json(NULL) && !kalmems_findings_column_count(NULL, true));
    kalmems_findings_free(NULL);
}

int main(int argc, char **argv) {
    REQUIRE(argc == 2);
    check_streams(argv[1]);
    check_findings(argv[1]);
    puts("streams and findings in C are those of the command");
    return 0;
}
