/*
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
/*
 * The device, with rates f and measurements h, in SI:
 * - electrostatic_force(slope, square) = 0.5*slope*square
 * - gaussian_comb(angle, nominal, width, bias) = nominal·exp(−(angle/width)²) + bias
 * - carrier_square = carrier_amplitude^2/2
 * - capacitance = gaussian_comb(angle, nominal_capacitance, angular_width, bias_capacitance)
 * - torque = electrostatic_force(d(capacitance, angle), (drive_gain*drive)^2 + carrier_square)
 * - acceleration = (torque - damping*rate - stiffness*angle)/inertia
 * - dangle/dt = rate
 * - drate/dt = acceleration
 * - signal = gain*capacitance + offset in V
 * The filter, with the covariance P of the states x, the noise Q of a step and the noise R of a sample:
 * - prediction: x = x + (integral of f over the step), F = (derivative of the new x by the old one), P = F P F' + Q
 * - correction by a measurement y: S = H P H' + R with H = (derivative of h by x), k = P H'/S, x = x + k (y - h),
 *   P = (1 - k H) P (1 - k H)' + k R k' = B + (k - B H') k' with B = P - k (P H')'
 * Names: x_ is a mean, p0_1 an entry of P, f0_1 of F, fp0_1 of F P, b0_1 of B; h_ an entry of H, ph_ of P H', gain_ of k; variance is S,
 * innovation y - h, and t0 a part of several of these. Noise and signal are in standard deviations of the noise, so that R = 1.
 */
#include "scanner_filter.h"

#include <stdint.h>

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0)
#error "gaps and refusals are seen by what is not a number: compile without -ffast-math"
#endif

/* a*b + c, rounded once on a processor of Arm that has an instruction for it. */
#ifdef __ARM_FEATURE_FMA
#if defined(__clang__)
#if __has_builtin(__builtin_elementwise_fma)
#define FUSED(a, b, c) __builtin_elementwise_fma((a), (b), (c))
#endif
#elif defined(__GNUC__)
#define FUSED(a, b, c) __builtin_fmaf((a), (b), (c))
#endif
#endif
#ifndef FUSED
#define FUSED(a, b, c) ((a) * (b) + (c))
#endif

/* Within a step nothing is called, so that the state stays in registers. */
#ifdef __GNUC__
#define WITHIN static inline __attribute__((always_inline))
#else
#define WITHIN static
#endif

/* What is not a number. */
WITHIN float nothing(void)
{
    union { uint32_t bits; float value; } none;
    none.bits = 0x7FC00000U;
    return none.value;
}

/* e^x for x <= 0: x = n ln 2 + r, a polynomial in r, and n added to the exponent. */
WITHIN float falling_exp(float x)
{
    union { float value; uint32_t bits; } result, count;
    float n, high, low, r, square, tail;
    if (!(x > -64.0F)) {
        /* Below 2e-28, and not a number of what is none. */
        return x <= -64.0F ? 0.0F : x;
    }
    count.value = FUSED(x, 1.44269504F, 12582912.0F);
    n = count.value - 12582912.0F;
    high = FUSED(-n, 0.693145752F, x);
    low = n * -1.42860677e-06F;
    r = high + low;
    square = r * r;
    tail = FUSED(FUSED(0.00138145813F, square, 0.041668389F), square, 0.49999994F);
    tail = FUSED(FUSED(0.00836872775F, square, 0.166665211F), r, tail);
    result.value = 1.0F + (high + FUSED(square, tail, low));
    result.bits += count.bits << 23;
    return result.value;
}

/* The unit of each state and what it is counted from, in SI. */
static const float UNIT[2] = {0.2F, 200000.0F};
static const float ORIGIN[2] = {0.0F, 0.0F};
/* The standard deviation of the noise of each measurement in SI. */
static const float DEVIATION[1] = {0.013856406F};

/* The median of chi squared with one degree of freedom. */
#define MEDIAN 0.454936415F

/* Before the first sample. */
static const scanner_filter_watch_t FRESH = {0.0F, 0.0F, 0.0F, 1.0F, MEDIAN, 0.0F, 0U, 0U, 0U, 0U};

/* Takes notice of an innovation in standard deviations of the noise and of its variance; 1 where the sample is taken. */
WITHIN int believed(scanner_filter_watch_t *watch, float residual, float variance)
{
    const float nis = residual * residual / variance;
    const int settles = watch->seen < 7999U;
    /* At the end of the settling time the share is that of its last quarter. */
    const float early = settles ? 4.0F / (4.0F + (float)watch->seen) : 0.0F;
    const float forgets = early > 0.0001F ? early : 0.0001F;
    const float bound = watch->median > MEDIAN ? 28.373987F * (watch->median / MEDIAN) : 28.373987F;
    const int beyond = nis > bound;
    const int taken = 1;
    int opens;
    if (settles) {
        watch->seen++;
    }
    if (!(variance > 0.0F && nis - nis == 0.0F)) {
        if (watch->since + 1U != 0U) {
            watch->since++;
        }
        return 0;
    }
    watch->residual = residual;
    watch->variance = variance;
    watch->nis = nis;
    watch->beyond += ((beyond ? 1.0F : 0.0F) - watch->beyond) * forgets;
    opens = watch->beyond > (watch->open > 0U ? 0.0625F : 0.125F);
    if (!opens) {
        watch->open = 0U;
    } else if (settles || (watch->open < 2U && nis <= 28.373987F)) {
        watch->open = 1U;
    } else if (nis <= 28.373987F) {
        watch->open--;
    } else if (watch->open + 1U != 0U) {
        watch->open++;
    }
    if (opens) {
        watch->suspect = 0U;
    } else if (beyond) {
        watch->suspect = watch->suspect < 14U ? watch->suspect + 2U : 16U;
    } else if (watch->suspect > 0U) {
        watch->suspect--;
    }
    if (!taken) {
        if (watch->since + 1U != 0U) {
            watch->since++;
        }
        return 0;
    }
    watch->since = 0U;
    watch->mean_nis += (nis - watch->mean_nis) * forgets;
    watch->median *= nis > watch->median ? 1.01574767F : 0.984496415F;
    if (watch->median < 0.25F * MEDIAN) {
        watch->median = 0.25F * MEDIAN;
    }
    return 1;
}

WITHIN void predict(scanner_filter_state_t *state, float u_drive_start)
{
    const float x_angle = state->mean[0];
    const float x_rate = state->mean[1];
    const float p0_0 = state->covariance[0];
    const float p1_0 = state->covariance[1];
    const float p1_1 = state->covariance[2];
    const float t0 = FUSED(u_drive_start, u_drive_start, 18.0F) * falling_exp(-(x_angle * x_angle));
    const float t1 = x_angle * t0;
    const float f1_0 = FUSED(2.4826086e-8F, (x_angle * t1), FUSED(-1.2413043e-8F, t0, -0.009593913F));
    const float next_rate = FUSED(-1.2413043e-8F, t1, FUSED(-0.009593913F, x_angle, 0.99948263F * x_rate));
    const float fp1_0 = FUSED(0.99948263F, p1_0, f1_0 * p0_0);
    const float fp1_1 = FUSED(0.99948263F, p1_1, f1_0 * p1_0);
    state->mean[0] = x_rate + x_angle;
    state->mean[1] = next_rate;
    state->covariance[0] = 8.3141316e-10F + (p0_0 + p1_0) + (p1_0 + p1_1);
    state->covariance[1] = 1.245363e-9F + fp1_0 + fp1_1;
    state->covariance[2] = FUSED(0.99948263F, fp1_1, FUSED(f1_0, fp1_0, 2.4907323e-9F));
}

WITHIN int update_signal(scanner_filter_state_t *state, scanner_filter_watch_t *watch, float y_signal)
{
    const float x_angle = state->mean[0];
    const float x_rate = state->mean[1];
    const float p0_0 = state->covariance[0];
    const float p1_0 = state->covariance[1];
    const float p1_1 = state->covariance[2];
    const float seen = y_signal;
    const float t0 = falling_exp(-(x_angle * x_angle));
    const float h_angle = 294.55746F * (x_angle * t0);
    const float innovation = FUSED(72.168785F, seen, FUSED(147.27873F, t0, -208.96861F));
    const float ph_angle = h_angle * p0_0;
    const float ph_rate = h_angle * p1_0;
    const float variance = FUSED(h_angle, ph_angle, 1.0F);
    const float inverse = 1.0F / variance;
    const float gain_angle = ph_angle * inverse;
    const float gain_rate = ph_rate * inverse;
    const float b0_0 = FUSED(-ph_angle, gain_angle, p0_0);
    const float b1_0 = FUSED(-ph_angle, gain_rate, p1_0);
    const float t1 = FUSED(-h_angle, b1_0, gain_rate);
    if (!believed(watch, innovation, variance)) {
        return 0;
    }
    state->mean[0] = FUSED(innovation, gain_angle, x_angle);
    state->mean[1] = FUSED(innovation, gain_rate, x_rate);
    state->covariance[0] = FUSED(gain_angle, FUSED(-h_angle, b0_0, gain_angle), b0_0);
    state->covariance[1] = FUSED(gain_angle, t1, b1_0);
    state->covariance[2] = FUSED(gain_rate, t1, FUSED(-ph_rate, gain_rate, p1_1));
    return 1;
}

/* Whether all numbers of a state are finite. */
WITHIN int is_finite(const scanner_filter_state_t *state)
{
    const float sum = state->mean[0]
                      + state->mean[1]
                      + state->covariance[0]
                      + state->covariance[1]
                      + state->covariance[2];
    return sum - sum == 0.0F;
}

/* Takes over a state where all its numbers are finite. */
WITHIN int take(scanner_filter_t *filter, const scanner_filter_state_t *state)
{
    if (!is_finite(state)) {
        return 0;
    }
    filter->state = *state;
    return 1;
}

/* The first state. */
WITHIN void first(scanner_filter_t *filter)
{
    unsigned k;
    filter->state.mean[0] = 0.25F;
    filter->state.mean[1] = 0.0F;
    filter->state.covariance[0] = 0.5625F;
    filter->state.covariance[1] = 0.0F;
    filter->state.covariance[2] = 0.005625F;
    for (k = 0U; k < SCANNER_FILTER_MEASUREMENTS; k++) {
        filter->watch[k] = FRESH;
    }
}

void scanner_filter_start(scanner_filter_t *filter)
{
    unsigned k;
    first(filter);
    filter->begun = 0U;
    for (k = 0U; k < 1U; k++) {
        filter->inputs[k] = 0.0F;
    }
    filter->missing = 0U;
}

/* Begins again as at the start, and counts it. */
WITHIN void restart(scanner_filter_t *filter)
{
    first(filter);
    filter->begun++;
}

/* An input; where it is not a number, the last one that was: time goes on. */
WITHIN float held(scanner_filter_t *filter, unsigned place, float input)
{
    if (input - input == 0.0F) {
        filter->inputs[place] = input;
    } else if (filter->missing + 1U != 0U) {
        filter->missing++;
    }
    return filter->inputs[place];
}

int scanner_filter_predict(scanner_filter_t *filter, float u_drive_start)
{
    scanner_filter_state_t next = filter->state;
    u_drive_start = held(filter, 0U, u_drive_start);
    predict(&next, u_drive_start);
    if (take(filter, &next)) {
        return 1;
    }
    restart(filter);
    return 0;
}

int scanner_filter_update_signal(scanner_filter_t *filter, float y_signal)
{
    scanner_filter_state_t next = filter->state;
    int taken;
    taken = update_signal(&next, &filter->watch[0], y_signal) && take(filter, &next);
    return taken;
}

int scanner_filter_step(scanner_filter_t *filter, float u_drive_start, float y_signal)
{
    scanner_filter_state_t next = filter->state;
    int taken = 1;
    u_drive_start = held(filter, 0U, u_drive_start);
    predict(&next, u_drive_start);
    taken &= update_signal(&next, &filter->watch[0], y_signal);
    if (!take(filter, &next)) {
        /* What follows from the measurements is not finite: the prediction alone. */
        (void)scanner_filter_predict(filter, u_drive_start);
        taken = 0;
    }
    return taken;
}

scanner_filter_status_t scanner_filter_status(const scanner_filter_t *filter, unsigned measurement)
{
    const scanner_filter_watch_t *const watch = &filter->watch[measurement < SCANNER_FILTER_MEASUREMENTS ? measurement : 0U];
    if (watch->seen < 7999U) {
        return SCANNER_FILTER_STARTING;
    }
    if (watch->open > 0U) {
        return SCANNER_FILTER_LOST;
    }
    if (watch->median > 4.0F * MEDIAN) {
        return SCANNER_FILTER_OVERCONFIDENT;
    }
    if (filter->begun > 0U && watch->since == 0U) {
        return SCANNER_FILTER_SIGN_UNSURE;
    }
    return watch->since > 0U ? SCANNER_FILTER_LEFT_OUT : SCANNER_FILTER_FOLLOWING;
}

float scanner_filter_innovation(const scanner_filter_t *filter, unsigned measurement)
{
    return measurement < SCANNER_FILTER_MEASUREMENTS ? DEVIATION[measurement] * filter->watch[measurement].residual : nothing();
}

float scanner_filter_innovation_variance(const scanner_filter_t *filter, unsigned measurement)
{
    return measurement < SCANNER_FILTER_MEASUREMENTS
               ? DEVIATION[measurement] * DEVIATION[measurement] * filter->watch[measurement].variance
               : nothing();
}

float scanner_filter_nis(const scanner_filter_t *filter, unsigned measurement)
{
    return measurement < SCANNER_FILTER_MEASUREMENTS ? filter->watch[measurement].nis : nothing();
}

unsigned scanner_filter_since(const scanner_filter_t *filter, unsigned measurement)
{
    return measurement < SCANNER_FILTER_MEASUREMENTS ? filter->watch[measurement].since : 0U;
}

float scanner_filter_value(const scanner_filter_t *filter, unsigned state)
{
    return state < 2U ? ORIGIN[state] + UNIT[state] * filter->state.mean[state] : nothing();
}

float scanner_filter_variance(const scanner_filter_t *filter, unsigned state)
{
    return state < 2U
               ? (UNIT[state] * UNIT[state]) * filter->state.covariance[state * (state + 3U) / 2U]
               : nothing();
}

float scanner_filter_angle_rad(const scanner_filter_t *filter)
{
    return 0.2F * filter->state.mean[SCANNER_FILTER_ANGLE];
}

void scanner_filter_set_angle_rad(scanner_filter_t *filter, float x_angle)
{
    filter->state.mean[SCANNER_FILTER_ANGLE] = x_angle / 0.2F;
}

float scanner_filter_rate_rad_per_s(const scanner_filter_t *filter)
{
    return 200000.0F * filter->state.mean[SCANNER_FILTER_RATE];
}

void scanner_filter_set_rate_rad_per_s(scanner_filter_t *filter, float x_rate)
{
    filter->state.mean[SCANNER_FILTER_RATE] = x_rate / 200000.0F;
}
