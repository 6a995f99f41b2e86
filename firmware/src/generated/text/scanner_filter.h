/*
 * An extended Kalman filter, made by kalmems-equations 0.1.0 from a device's equations; not to be edited.
 * Made by kalmems 0.1.0 with `kalmems export`; not to be edited.
 * Experiment `scanner_filter`, sha256 22827e5ef19e697e0aca21105e2fe23d62450b77fca820ffdd0bc24770b39a0a, filter `Euler EKF`.
 * Sampling interval 1.0000000000001327e-6 s, corrected by every sample.
 * Sampling interval 1.0000000000001327e-6 s, steps by Euler's method.
 * Numbers have 32 bits.
 * In a rehearsal with numbers of 32 bits the largest difference from the filter of the library was 6.1e-7 of the largest value of a state.
 */
#ifndef SCANNER_FILTER_H
#define SCANNER_FILTER_H

#ifdef __cplusplus
extern "C" {
#endif

/* How many states there are:
 * 0: angle, in units of 0.19999999999999998 in SI (rad)
 * 1: rate, in units of 199999.9999999735 in SI (rad/s)
 */
#define SCANNER_FILTER_STATES 2

/* The sampling interval in s. */
#define SCANNER_FILTER_INTERVAL_S 1e-6F

/* What is estimated, each state in its unit. */
typedef struct {
    float mean[2];
    float covariance[3]; /* the lower triangle, row by row */
} scanner_filter_state_t;

typedef struct {
    scanner_filter_state_t state;
} scanner_filter_t;

/* Before the first sample. */
void scanner_filter_start(scanner_filter_t *filter);

/*
 * One interval on. 1 where it was taken; 0 where the result would not be finite, and nothing has changed.
 * drive in SI (V)
 */
int scanner_filter_predict(scanner_filter_t *filter, float u_drive_start);

/* Corrects by a measurement in SI (V). 1 where it was taken; 0 where it is refused, and nothing has changed. */
int scanner_filter_update_signal(scanner_filter_t *filter, float y_signal);

/*
 * The prediction and all corrections of one sample. 1 where all were taken. 0 where one is refused and left out;
 * a sample that is not a number is a gap, and refused behind the prediction.
 */
int scanner_filter_step(scanner_filter_t *filter, float u_drive_start, float y_signal);

/* The mean of a state in SI. */
float scanner_filter_value(const scanner_filter_t *filter, unsigned state);

/* The variance of a state in SI. */
float scanner_filter_variance(const scanner_filter_t *filter, unsigned state);

#ifdef __cplusplus
}
#endif

#endif
