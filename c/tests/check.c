/* What a program in C sees of the library: estimates of arrays, errors with their place, a stop, and nothing that leaks. */
#include <math.h>
#include <signal.h>
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

/* The columns of a CSV file of numbers with one line of names. */
static char names[16][32];
static double *columns[16];
static size_t width, rows;

static void read_csv(const char *path) {
    static char line[1024];
    FILE *file = fopen(path, "r");
    REQUIRE(file);
    while (fgets(line, sizeof line, file)) {
        if (line[0] == '#') continue;
        size_t column = 0;
        for (char *cell = strtok(line, ",\n"); cell; cell = strtok(NULL, ",\n"), column++) {
            if (!width || column >= width) {
                REQUIRE(column < 16 && strlen(cell) < 32);
                strcpy(names[column], cell);
                columns[column] = malloc(1000000 * sizeof(double));
            } else {
                columns[column][rows] = strtod(cell, NULL);
            }
        }
        if (width) rows++;
        width = column;
    }
    fclose(file);
}

static bool stop_at_once(const char *what, uint64_t done, uint64_t total, void *user) {
    REQUIRE(what && done <= total);
    ++*(int *)user;
    return false;
}

static volatile sig_atomic_t signals_heard;

static void count_signal(int number) {
    (void)number;
    signals_heard++;
}

int main(int argc, char **argv) {
    REQUIRE(argc == 3);
    KalmemsError *error = NULL;
    char version_of_header[32];
    snprintf(version_of_header, sizeof version_of_header, "%d.%d.%d", KALMEMS_VERSION_MAJOR, KALMEMS_VERSION_MINOR, KALMEMS_VERSION_PATCH);
    REQUIRE(!strcmp(kalmems_version(), version_of_header));

    /* Files. */
    KalmemsExperiment *experiment = kalmems_experiment_open(argv[1], &error);
    REQUIRE(experiment && !error);
    KalmemsEstimate *of_files = kalmems_estimate(experiment, NULL, NULL, &error);
    REQUIRE(of_files && !error);

    /* The same numbers as arrays: equal to the last bit. */
    read_csv(argv[2]);
    KalmemsRecording *recording = kalmems_recording_new();
    for (size_t i = 0; i < width; i++) REQUIRE(kalmems_recording_add(recording, names[i], columns[i], rows, &error));
    REQUIRE(kalmems_experiment_give(experiment, NULL, recording, &error));
    kalmems_recording_free(recording);
    KalmemsEstimate *of_arrays = kalmems_estimate(experiment, NULL, NULL, &error);
    REQUIRE(of_arrays && !error);
    REQUIRE(kalmems_trajectory_count(of_arrays) == kalmems_trajectory_count(of_files) && kalmems_trajectory_count(of_files) > 1);
    size_t compared = 0, claimless = 0;
    for (size_t k = 0; k < kalmems_trajectory_count(of_files); k++) {
        REQUIRE(!strcmp(kalmems_trajectory_name(of_files, k), kalmems_trajectory_name(of_arrays, k)));
        REQUIRE(kalmems_trajectory_passes(of_files, k) == kalmems_trajectory_passes(of_arrays, k));
        /* The model alone claims nothing, so that nothing passes. */
        REQUIRE(strcmp(kalmems_trajectory_grade(of_files, k), "no_claim") || !kalmems_trajectory_passes(of_files, k));
        claimless += !strcmp(kalmems_trajectory_grade(of_files, k), "no_claim");
        for (size_t i = 0; i < kalmems_column_count(of_files, k); i++) {
            KalmemsColumn a = {.struct_size = sizeof a}, b = {.struct_size = sizeof b};
            REQUIRE(kalmems_column(of_files, k, i, &a, &error) && kalmems_column(of_arrays, k, i, &b, &error));
            REQUIRE(!strcmp(a.name, b.name) && !strcmp(a.unit, b.unit) && a.count == b.count);
            REQUIRE(a.count == 0 || !memcmp(a.numbers, b.numbers, a.count * sizeof(double)));
            if (!strcmp(a.name, "angle")) compared += a.count;
        }
        KalmemsColumn none = {.struct_size = sizeof none}, unset = {.struct_size = 0};
        REQUIRE(!kalmems_column(of_files, k, 0, &unset, &error) && strstr(kalmems_error_message(error), "struct_size"));
        kalmems_error_free(error);
        error = NULL;
        REQUIRE(!kalmems_column(of_files, k, 1000, &none, &error) && kalmems_error_kind(error) == KALMEMS_ERROR_KIND_ARGUMENT);
        kalmems_error_free(error);
        error = NULL;
    }
    REQUIRE(compared >= 2 * rows);
    REQUIRE(claimless > 0);
    REQUIRE(!kalmems_trajectory_grade(of_files, 1000));

    /* The command leaves the handlers of its host as they are, and takes no null pointer for arguments. */
    signal(SIGINT, count_signal);
    const char *const version[] = {"kalmems", "schema", "experiment", "--write", "/dev/null/none"};
    REQUIRE(kalmems_run(5, version) != 0);
    raise(SIGINT);
    REQUIRE(signals_heard == 1);
    REQUIRE(kalmems_run(1, NULL) == 2);
    const char *const nothing[] = {NULL};
    REQUIRE(kalmems_run(1, nothing) == 2);
    REQUIRE(strstr(kalmems_estimate_metrics(of_arrays), "\"mean_nis\""));
    REQUIRE(strstr(kalmems_estimate_summary(of_arrays), "EKF"));
    REQUIRE(kalmems_estimate_notice_count(of_arrays) > 0 && kalmems_estimate_notice(of_arrays, 0));
    REQUIRE(!kalmems_estimate_notice(of_arrays, 1000));
    char *html = kalmems_estimate_report(of_arrays, &error);
    REQUIRE(html && strstr(html, "<html"));
    kalmems_text_free(html);

    /* A stop. */
    int heard = 0;
    REQUIRE(!kalmems_estimate(experiment, stop_at_once, &heard, &error));
    REQUIRE(heard > 0 && kalmems_error_kind(error) == KALMEMS_ERROR_KIND_INTERRUPTED);
    kalmems_error_free(error);
    error = NULL;

    /* Errors say where. */
    KalmemsExperiment *wrong = kalmems_experiment_parse("name = \"x\"\ndecription = \"y\"\n", "wrong.toml", &error);
    if (wrong) REQUIRE(!kalmems_estimate(wrong, NULL, NULL, &error));
    REQUIRE(kalmems_error_kind(error) == KALMEMS_ERROR_KIND_EXPERIMENT);
    REQUIRE(strstr(kalmems_error_message(error), "did you mean `description`"));
    REQUIRE(!strcmp(kalmems_error_file(error), "wrong.toml") && kalmems_error_line(error) == 2);
    REQUIRE(!strcmp(kalmems_error_key(error), "decription"));
    kalmems_error_free(error);
    kalmems_experiment_free(wrong);
    error = NULL;
    REQUIRE(!kalmems_experiment_open("no/such/file.toml", &error) && strstr(kalmems_error_message(error), "no/such/file.toml"));
    kalmems_error_free(error);
    error = NULL;
    REQUIRE(!kalmems_experiment_open("\xff", &error) && kalmems_error_kind(error) == KALMEMS_ERROR_KIND_ARGUMENT);
    kalmems_error_free(error);
    error = NULL;
    REQUIRE(!kalmems_estimate(NULL, NULL, NULL, &error) && strstr(kalmems_error_message(error), "null"));
    kalmems_error_free(error);
    REQUIRE(!kalmems_estimate(NULL, NULL, NULL, NULL));
    REQUIRE(!kalmems_trajectory_name(of_arrays, 1000) && !kalmems_trajectory_count(NULL));

    kalmems_estimate_free(of_arrays);
    kalmems_estimate_free(of_files);
    kalmems_experiment_free(experiment);
    kalmems_error_free(NULL);
    for (size_t i = 0; i < width; i++) free(columns[i]);
    puts("the library does for C what the command does");
    return 0;
}
