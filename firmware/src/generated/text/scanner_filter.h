/**
 * @file
 * An extended Kalman filter, made by kalmems-equations 0.1.0 from a device's equations; not to be edited.
 * Made by kalmems 0.1.0 with `kalmems export`; not to be edited.
 * Experiment `scanner_filter`, sha256 51a681629ee8070a0d188834044079e2436f52a6fbf4dae4848ef4530e09c416, filter `Euler EKF`.
 * Sampling interval 1.0000000000000243e-6 s, corrected by every sample.
 * The signal is the same for the mirrored motion, and the source mirrors nothing: its sign is that of the start.
 * A step goes over 1.0000000000000243e-6 s, by Euler's method.
 * Numbers have 32 bits.
 * Its constants are those of these parameters, in SI:
 * - inertia = 1.15e-14 kg m^2
 * - damping = 5.95e-12 N m s
 * - stiffness = 0.00011033 N m
 * - nominal_capacitance = 5.71e-12 F
 * - angular_width = 0.2 rad
 * - bias_capacitance = 9.79e-12 F
 * - drive_gain = 1.0
 * - gain = -357400000000.0 V/F
 * - offset = 6.3945 V
 * - noise_variance = 0.000192 V^2
 * - carrier_amplitude = 6.0 V
 * In a rehearsal with numbers of 32 bits over up to 24000 samples the largest difference from the filter of the library was 8.3e-7 of the largest value of a state.
 */
#ifndef SCANNER_FILTER_H
#define SCANNER_FILTER_H

#ifdef __cplusplus
extern "C" {
#endif

/** How many states there are:
 * 0: angle, in units of 0.19999999999999998 in SI (rad)
 * 1: rate, in units of 199999.9999999951 in SI (rad/s)
 */
#define SCANNER_FILTER_STATES 2U

/** The sampling interval in s. */
#define SCANNER_FILTER_INTERVAL_S 1e-6F

/** How many measurements correct it. */
#define SCANNER_FILTER_MEASUREMENTS 1U

/** A step corrects by one sample in so many. */
#define SCANNER_FILTER_UPDATE_EVERY 1U

/** The place of each state. */
enum {
    SCANNER_FILTER_ANGLE,
    SCANNER_FILTER_RATE
};

/** What is estimated, each state in its unit. */
typedef struct {
    float mean[2];
    float covariance[3]; /**< the lower triangle, row by row */
} scanner_filter_state_t;

/** What the corrections by a measurement saw. */
typedef struct {
    float residual; /**< measured minus predicted, in standard deviations of the noise */
    float variance; /**< of that by the filter */
    float nis;      /**< the normalised innovation squared; its mean is 1 of a filter that is right */
    float mean_nis; /**< the mean of those that were taken last */
    float median;   /**< what follows their median; 0.455 of a filter that is right */
    float beyond;   /**< the share of the last samples that were beyond the bound */
    unsigned since; /**< samples since the last that was taken */
    unsigned seen;  /**< samples from the start on, up to the end of the settling time */
    unsigned suspect; /**< how suspect the next sample is */
    unsigned open;  /**< 0, or, where too many were beyond the bound and all are taken, 1 and how many more were since then than within */
} scanner_filter_watch_t;

/**
 * How a filter stands to a measurement. It is STARTING up to the end of the settling time, where it has one. From then on:
 * - FOLLOWING -> LEFT_OUT: a sample is missing or beyond the bound. LEFT_OUT -> FOLLOWING: a sample is taken.
 * - -> OVERCONFIDENT: the squares of the innovations have a median above four times the expected one; back below that.
 * - -> LOST: an eighth of the last samples were beyond the bound, and all are taken. LOST -> FOLLOWING: less than a sixteenth are, or the state that was
 *   kept from before predicts the signal again. LOST -> STARTING: the filter has begun again as at the start.
 * - FOLLOWING is SIGN_UNSURE once it has lost what it knew of the motion, if another motion has the same signals.
 * Where several hold, the first one of STARTING, LOST, OVERCONFIDENT, SATURATED, LEFT_OUT and SIGN_UNSURE is said.
 */
typedef enum {
    SCANNER_FILTER_STARTING,      /**< it settles: every sample is taken */
    SCANNER_FILTER_FOLLOWING,     /**< the last sample was taken, and samples are as near as the filter says */
    SCANNER_FILTER_LEFT_OUT,      /**< the last sample was not taken: it is missing, or none of the signal */
    SCANNER_FILTER_OVERCONFIDENT, /**< samples are more than twice as far from their predictions as it says: do not trust its variances */
    SCANNER_FILTER_SIGN_UNSURE,   /**< as following, but the signal is the same for another motion, such as the mirrored one, which it may follow */
    SCANNER_FILTER_LOST,          /**< too many samples are none of the signal that it follows: do not trust its means */
    SCANNER_FILTER_SATURATED      /**< the last sample was at an end of the range of its instrument: a gap */
} scanner_filter_status_t;

typedef struct {
    scanner_filter_state_t state;
    scanner_filter_watch_t watch[SCANNER_FILTER_MEASUREMENTS];
    unsigned begun; /**< how often it has lost its signal or its numbers, and what it knew of the motion */
    float inputs[1]; /**< the last that were numbers */
    unsigned missing; /**< how many were none */
} scanner_filter_t;

/** Before the first sample. */
void scanner_filter_start(scanner_filter_t *filter);

/**
 * One interval on. An input that is not a number is taken for the last one that was. 1 where it was taken; 0 where the result would not be
 * finite, and the filter has begun again.
 * drive in SI (V)
 */
int scanner_filter_predict(scanner_filter_t *filter, float u_drive_start);

/** Corrects by a measurement in SI (V). 1 where it was taken; 0 where it is refused, and nothing has changed. */
int scanner_filter_update_signal(scanner_filter_t *filter, float y_signal);

/**
 * The prediction and all corrections of one sample. 1 where all were taken; 0 where one is left out: a sample that is not a number is a
 * gap, and one that is too far from what is expected is none of the signal.
 */
int scanner_filter_step(scanner_filter_t *filter, float u_drive_start, float y_signal);

/** How it stands to a measurement, the first of which is 0. */
scanner_filter_status_t scanner_filter_status(const scanner_filter_t *filter, unsigned measurement);

/** What was last measured of it, minus what was predicted, in SI. Not a number of a measurement that there is not. */
float scanner_filter_innovation(const scanner_filter_t *filter, unsigned measurement);

/** The variance of that by the filter, in SI. */
float scanner_filter_innovation_variance(const scanner_filter_t *filter, unsigned measurement);

/** The normalised innovation squared; its mean is 1 of a consistent filter. */
float scanner_filter_nis(const scanner_filter_t *filter, unsigned measurement);

/** Samples since the last one that was taken. */
unsigned scanner_filter_since(const scanner_filter_t *filter, unsigned measurement);

/** The mean of a state in SI. Not a number of a state that there is not. */
float scanner_filter_value(const scanner_filter_t *filter, unsigned state);

/** The mean of angle in rad. */
float scanner_filter_angle_rad(const scanner_filter_t *filter);

/** Takes a mean of angle in rad, and leaves the covariance as it is. */
void scanner_filter_set_angle_rad(scanner_filter_t *filter, float x_angle);

/** The mean of rate in rad per s. */
float scanner_filter_rate_rad_per_s(const scanner_filter_t *filter);

/** Takes a mean of rate in rad per s, and leaves the covariance as it is. */
void scanner_filter_set_rate_rad_per_s(scanner_filter_t *filter, float x_rate);

/** The variance of a state in SI. */
float scanner_filter_variance(const scanner_filter_t *filter, unsigned state);

#ifdef __cplusplus
}
#endif

#endif
