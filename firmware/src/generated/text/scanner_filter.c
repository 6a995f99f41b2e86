/*
 * An extended Kalman filter, made by kalmems-equations 0.1.0 from a device's equations; not to be edited.
 * Made by kalmems 0.1.0 with `kalmems export`; not to be edited.
 * Experiment `scanner_filter`, sha256 22827e5ef19e697e0aca21105e2fe23d62450b77fca820ffdd0bc24770b39a0a, filter `Euler EKF`.
 * Sampling interval 1.0000000000001327e-6 s, corrected by every sample.
 * Sampling interval 1.0000000000001327e-6 s, steps by Euler's method.
 * Numbers have 32 bits.
 * In a rehearsal with numbers of 32 bits the largest difference from the filter of the library was 6.1e-7 of the largest value of a state.
 */
#include "scanner_filter.h"

#include <stdint.h>

#ifdef __FAST_MATH__
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

WITHIN void predict(scanner_filter_state_t *state, float u_drive_start)
{
    const float x_angle = state->mean[0];
    const float x_rate = state->mean[1];
    const float p0_0 = state->covariance[0];
    const float p1_0 = state->covariance[1];
    const float p1_1 = state->covariance[2];
    const float t0 = FUSED(u_drive_start, u_drive_start, 18.0F) * falling_exp(-(x_angle * x_angle));
    const float t1 = x_angle * t0;
    const float t2 = FUSED(2.4826086e-8F, (x_angle * t1), FUSED(-1.2413043e-8F, t0, -0.009593913F));
    const float t3 = FUSED(-1.2413043e-8F, t1, FUSED(-0.009593913F, x_angle, 0.99948263F * x_rate));
    const float t4 = FUSED(0.99948263F, p1_0, t2 * p0_0);
    const float t5 = FUSED(0.99948263F, p1_1, t2 * p1_0);
    state->mean[0] = x_rate + x_angle;
    state->mean[1] = t3;
    state->covariance[0] = 8.3141316e-10F + (p0_0 + p1_0) + (p1_0 + p1_1);
    state->covariance[1] = 1.245363e-9F + t4 + t5;
    state->covariance[2] = FUSED(0.99948263F, t5, FUSED(t2, t4, 2.4907323e-9F));
}

WITHIN int update_signal(scanner_filter_state_t *state, float y_signal)
{
    const float x_angle = state->mean[0];
    const float x_rate = state->mean[1];
    const float p0_0 = state->covariance[0];
    const float p1_0 = state->covariance[1];
    const float p1_1 = state->covariance[2];
    const float seen = y_signal;
    const float t0 = falling_exp(-(x_angle * x_angle));
    const float t1 = 294.55746F * (x_angle * t0);
    const float t2 = FUSED(72.168785F, seen, FUSED(147.27873F, t0, -208.96861F));
    const float t3 = t1 * p0_0;
    const float t4 = t1 * p1_0;
    const float t5 = FUSED(t1, t3, 1.0F);
    const float t6 = 1.0F / t5;
    const float t7 = t3 * t6;
    const float t8 = t4 * t6;
    const float t9 = FUSED(-t3, t7, p0_0);
    const float t10 = FUSED(-t3, t8, p1_0);
    const float t11 = FUSED(-t1, t10, t8);
    state->mean[0] = FUSED(t2, t7, x_angle);
    state->mean[1] = FUSED(t2, t8, x_rate);
    state->covariance[0] = FUSED(t7, FUSED(-t1, t9, t7), t9);
    state->covariance[1] = FUSED(t7, t11, t10);
    state->covariance[2] = FUSED(t8, t11, FUSED(-t4, t8, p1_1));
    return t5 > 0.0F;
}

/* Takes over a state where all its numbers are finite. */
WITHIN int take(scanner_filter_t *filter, const scanner_filter_state_t *state)
{
    const float sum = state->mean[0]
                      + state->mean[1]
                      + state->covariance[0]
                      + state->covariance[1]
                      + state->covariance[2];
    if (!(sum - sum == 0.0F)) {
        return 0;
    }
    filter->state = *state;
    return 1;
}

void scanner_filter_start(scanner_filter_t *filter)
{
    filter->state.mean[0] = 0.25F;
    filter->state.mean[1] = 0.0F;
    filter->state.covariance[0] = 0.5625F;
    filter->state.covariance[1] = 0.0F;
    filter->state.covariance[2] = 0.005625F;
}

int scanner_filter_predict(scanner_filter_t *filter, float u_drive_start)
{
    scanner_filter_state_t next = filter->state;
    predict(&next, u_drive_start);
    return take(filter, &next);
}

int scanner_filter_update_signal(scanner_filter_t *filter, float y_signal)
{
    scanner_filter_state_t next = filter->state;
    return update_signal(&next, y_signal) && take(filter, &next);
}

int scanner_filter_step(scanner_filter_t *filter, float u_drive_start, float y_signal)
{
    scanner_filter_state_t next = filter->state;
    int taken = 1;
    predict(&next, u_drive_start);
    taken &= update_signal(&next, y_signal);
    if (taken && take(filter, &next)) {
        return 1;
    }
    /* One is refused: each for itself. */
    taken = scanner_filter_predict(filter, u_drive_start);
    if (!taken) {
        return 0;
    }
    taken &= scanner_filter_update_signal(filter, y_signal);
    return taken;
}

float scanner_filter_value(const scanner_filter_t *filter, unsigned state)
{
    return state < 2U ? ORIGIN[state] + UNIT[state] * filter->state.mean[state] : 0.0F;
}

float scanner_filter_variance(const scanner_filter_t *filter, unsigned state)
{
    return state < 2U
               ? UNIT[state] * UNIT[state] * filter->state.covariance[state * (state + 3U) / 2U]
               : 0.0F;
}
