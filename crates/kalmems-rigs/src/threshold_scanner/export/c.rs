//! The filter of a threshold-sensing scanner and its detector in C99.

use super::scaled::ScaledThreshold;
use crate::export::ExportError;
use crate::source_code::c::{self, PRELUDE, comment, constants, float};
use kalmems_core::detect::angle_at;
use kalmems_models::capacitance::CurveShape;

/// Header and source; `name` begins the names of types and functions and is a C name.
pub fn files(
    scaled: &ScaledThreshold,
    interval_s: f64,
    name: &str,
    heading: &[String],
) -> Result<Vec<(String, String)>, ExportError> {
    let (upper, comment) = (name.to_uppercase(), comment(heading));
    let (half, (fit_width, fit)) = (scaled.kernel.1, scaled.fit);
    let ((slope_weights, kernel), (fit_weights, cubic)) = (scaled.slope()?, scaled.cubic()?);
    let constants = constants(&upper, [scaled.angle_unit, scaled.rate_unit, scaled.per_volt, interval_s]);
    let fill = |text: &str| {
        text.replace("@name@", name)
            .replace("@UPPER@", &upper)
            .replace("@comment@", &comment)
            .replace("@constants@", &constants)
            .replace("@memory@", &scaled.memory.to_string())
            .replace("@reach@", &scaled.reach.to_string())
            .replace("@look_ahead@", &scaled.look_ahead.to_string())
    };
    let [slope_weights, fit_weights] = [slope_weights, fit_weights].map(|weights| table(weights.into_iter()));
    let [m0, m2, m4, m6] = cubic.moments;
    // The last sample that a crossing is about is so far back; from there on by the fit's displacement.
    #[allow(clippy::cast_precision_loss)] // a few hundred
    let [back] = angle_at(&scaled.system, scaled.look_ahead as f64).matrix.0;
    let curve = match scaled.shape {
        CurveShape::Logistic => LOGISTIC,
        CurveShape::Gaussian => GAUSSIAN,
    };
    let gate = scaled.gate_nis.map(|nis| GATE.replace("@nis@", &float(nis))).unwrap_or_default();
    let body = [PRELUDE, FINDER, curve, FILTER].concat();
    let body = [
        ("half", half.to_string()),
        ("rest_of_slope", if half % SUMS == 0 { String::new() } else { REST_OF_SLOPE.to_owned() }),
        ("fit", fit.to_string()),
        ("slope_weights", slope_weights),
        ("fit_weights", fit_weights),
        ("level", float(scaled.deviations * kernel.noise_gain().sqrt())),
        ("fit_scale", float(1.0 / fit_width)),
        ("m0", float(m0)),
        ("m2", float(m2)),
        ("m4", float(m4)),
        ("m6", float(m6)),
        ("even", float(1.0 / (m0 * m4 - m2 * m2))),
        ("odd", float(1.0 / (m2 * m6 - m4 * m4))),
        ("value_gain", float(cubic.noise_gain)),
        ("back0", float(back[0])),
        ("back1", float(back[1])),
        ("a10", float(scaled.system.0[1][0])),
        ("a11", float(scaled.system.0[1][1])),
        ("threshold", float(scaled.angle)),
        ("least", float(scaled.least_variance)),
        ("gate", gate),
        ("share", float(scaled.share())),
        ("twice", float(1.0 + scaled.share())),
        ("centre", float(scaled.centre)),
        ("gain", float(scaled.gain)),
        ("offset", float(scaled.offset)),
        ("variance", float(scaled.variance)),
        ("f00", float(scaled.transition[0][0])),
        ("f01", float(scaled.transition[0][1])),
        ("f10", float(scaled.transition[1][0])),
        ("f11", float(scaled.transition[1][1])),
        ("q00", float(scaled.noise[0])),
        ("q10", float(scaled.noise[1])),
        ("q11", float(scaled.noise[2])),
        ("angle", float(scaled.start[0])),
        ("rate", float(scaled.start[1])),
        ("p00", float(scaled.start_sd[0].powi(2))),
        ("p11", float(scaled.start_sd[1].powi(2))),
    ]
    .iter()
    .fold(body, |text, (place, value)| text.replace(&format!("@{place}@"), value));
    let source = fill(&format!("/*\n@comment@ */\n#include \"@name@.h\"\n{body}"));
    Ok(c::files(name, [fill(HEADER), source]))
}

/// Numbers as the inside of an array.
fn table(values: impl Iterator<Item = f64>) -> String {
    let values: Vec<String> = values.map(float).collect();
    let rows: Vec<String> = values.chunks(8).map(|row| format!("    {}", row.join(", "))).collect();
    rows.join(",\n")
}

/// The sums of the smoothed slope, each of which takes one sample of a group.
const SUMS: usize = 4;

const HEADER: &str = r#"/*
@comment@ */
#ifndef @UPPER@_H
#define @UPPER@_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

@constants@/* How many samples after it happened a crossing is known. */
#define @UPPER@_LOOK_AHEAD @look_ahead@U

/* A maximum of the smoothed slope. */
typedef struct {
    float height;
    uint32_t at; /* which sample, counted round and round */
} @name@_peak_t;

/* Mean and covariance of angle and rate, in their units, and what finds crossings. */
typedef struct {
    float angle, rate;
    float p00, p10, p11;
    uint32_t crossings; /* how many there were */
    /* From here on nothing is of use outside. Each sample is kept twice, so that one slice begins at the oldest. */
    float samples[2 * @memory@];
    unsigned oldest; /* where in a half */
    unsigned whole; /* how many numbers in a row are the newest, as far as the kernel reaches */
    float slopes[2]; /* the two newest, the older first */
    uint32_t count; /* of slopes, round and round */
    @name@_peak_t peaks[@reach@]; /* of which none is followed by a higher one: a ring, the oldest and highest first */
    unsigned first, filled;
} @name@_t;

/* Before the first sample. */
void @name@_start(@name@_t *filter);

/* Takes in the first sample, in V. 1 where it was taken; 0 where it is refused. */
int @name@_begin(@name@_t *filter, float signal_v);

/*
 * Goes on to the next sample, in V: a prediction, a correction by a crossing if one is known now, and a correction by
 * the sample. 1 where all were taken. 0 where one is refused, and what would have come after it is left out; a sample
 * that is not a number is a gap, and refused behind the prediction.
 */
int @name@_step(@name@_t *filter, float signal_v);

#ifdef __cplusplus
}
#endif

#endif
"#;

const FINDER: &str = r"
#define HALF @half@U
#define FIT @fit@U
#define REACH @reach@U
#define MEMORY @memory@U

/* The slope of the signal, smoothed by a Gaussian: n * e^(-n^2/2s^2), n = 1, 2, ... on each side. */
static const float SLOPE_WEIGHTS[HALF] = {
@slope_weights@
};

/* The weights of the cubic's samples, n = 1, 2, ... on each side; 1 in the middle. */
static const float FIT_WEIGHTS[FIT] = {
@fit_weights@
};

static float not_a_number(void)
{
    union { uint32_t bits; float value; } none;
    none.bits = 0x7FC00000U;
    return none.value;
}

static float size_of(float x)
{
    return x < 0.0F ? -x : x;
}

/* The smoothed slope in the middle of the newest 2 HALF + 1 samples. */
static float smoothed_slope(const float *newest)
{
    float sums[4] = {0.0F, 0.0F, 0.0F, 0.0F};
    unsigned n;
    /* Four sums side by side: each waits for its own last addition alone. */
    for (n = 0; n + 4U <= HALF; n += 4U) {
        unsigned i;
        for (i = 0; i < 4U; i++) {
            sums[i] = sums[i] + SLOPE_WEIGHTS[n + i] * (newest[HALF + 1U + n + i] - newest[HALF - 1U - n - i]);
        }
    }
@rest_of_slope@    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

static @name@_peak_t *peak(@name@_t *filter, unsigned after_the_oldest)
{
    const unsigned place = filter->first + after_the_oldest;
    return &filter->peaks[place < REACH ? place : place - REACH];
}

/* Drops the oldest maxima that are at least as many samples ago. */
static void forget(@name@_t *filter, uint32_t newest, uint32_t age)
{
    while (filter->filled > 0U && (uint32_t)(newest - peak(filter, 0U)->at) >= age) {
        filter->first = filter->first + 1U < REACH ? filter->first + 1U : 0U;
        filter->filled--;
    }
}

/* Takes in a sample; whether a crossing is known now. */
static int found(@name@_t *filter, float signal)
{
    const uint32_t newest = filter->count;
    const float before = filter->slopes[0], height = filter->slopes[1];
    float slope;
    int risen, is_peak, decided;
    filter->samples[filter->oldest] = signal;
    filter->samples[filter->oldest + MEMORY] = signal;
    filter->oldest = filter->oldest + 1U < MEMORY ? filter->oldest + 1U : 0U;
    filter->whole = !is_finite(signal) ? 0U : filter->whole > 2U * HALF ? filter->whole : filter->whole + 1U;
    slope = filter->whole > 2U * HALF
                ? smoothed_slope(&filter->samples[filter->oldest + MEMORY - (2U * HALF + 1U)])
                : not_a_number();
    filter->slopes[0] = height;
    filter->slopes[1] = slope;
    filter->count = newest + 1U;
    risen = height > @level@;
    if (!risen && filter->filled == 0U) {
        return 0;
    }
    is_peak = risen && height > before && is_finite(slope) && !(height < slope);
    /* A maximum is a crossing once none within REACH samples on either side has been higher. */
    forget(filter, newest, 2U * REACH + 2U);
    decided = filter->filled > 0U && (uint32_t)(newest - peak(filter, 0U)->at) == REACH + 1U
              && !(is_peak && height > peak(filter, 0U)->height);
    forget(filter, newest, 2U * REACH + 1U);
    if (is_peak) {
        while (filter->filled > 0U && peak(filter, filter->filled - 1U)->height < height) {
            filter->filled--;
        }
        peak(filter, filter->filled)->height = height;
        peak(filter, filter->filled)->at = newest - 1U;
        filter->filled++;
    }
    return decided;
}

/* The derivative of a cubic. */
static float cubic_slope(const float c[4], float u)
{
    return c[1] + u * (2.0F * c[2] + u * c[3] * 3.0F);
}

/* The cubic around a sample, u in widths of its Gaussian. */
static void fit_cubic(const float *centre, float c[4])
{
    float sums[4], u = 0.0F;
    unsigned n;
    sums[0] = centre[0] - @offset@;
    sums[1] = sums[2] = sums[3] = 0.0F;
    for (n = 1; n <= FIT; n++) {
        const float weight = FIT_WEIGHTS[n - 1U], later = centre[n], earlier = *(centre - n);
        float even, odd;
        u = u + @fit_scale@;
        even = weight * ((later - @offset@) + (earlier - @offset@));
        odd = weight * u * (later - earlier);
        sums[0] = sums[0] + even;
        sums[1] = sums[1] + odd;
        sums[2] = sums[2] + even * (u * u);
        sums[3] = sums[3] + odd * (u * u);
    }
    c[0] = (@m4@ * sums[0] - @m2@ * sums[2]) * @even@;
    c[1] = (@m6@ * sums[1] - @m4@ * sums[3]) * @odd@;
    c[2] = (@m0@ * sums[2] - @m2@ * sums[0]) * @even@;
    c[3] = (@m2@ * sums[3] - @m4@ * sums[1]) * @odd@;
}

/* The zero of a cubic that Newton's method finds from the middle, within two widths. 0 where there is none. */
static int zero_of(const float c[4], float *zero)
{
    float u = 0.0F;
    int i;
    for (i = 0; i < 32; i++) {
        const float step = (c[0] + u * (c[1] + u * (c[2] + u * c[3]))) / cubic_slope(c, u);
        u = u - step;
        if (!(size_of(u) < 2.0F)) {
            return 0;
        }
        if (size_of(step) < 1e-6F) {
            *zero = u;
            return 1;
        }
    }
    return 0;
}

/*
 * Where the signal crosses zero near the sample LOOK_AHEAD ago, in samples after it, and its slope there. The cubic is
 * moved by whole samples until its zero is within half a sample of its middle, three times at most.
 */
static int zero_crossing(const @name@_t *filter, float *displacement, float *slope)
{
    const float *kept = &filter->samples[filter->oldest];
    unsigned centre = MEMORY - 1U - @look_ahead@U;
    float moved = 0.0F, c[4], zero, left;
    int move;
    for (move = 0; move <= 3; move++) {
        if (centre < FIT || centre + FIT >= MEMORY) {
            return 0;
        }
        fit_cubic(&kept[centre], c);
        if (!(is_finite(c[0]) && is_finite(c[1]) && is_finite(c[2]) && is_finite(c[3])) || !zero_of(c, &zero)) {
            return 0;
        }
        left = zero / @fit_scale@;
        if (move == 3 || !(size_of(left) > 0.5F)) {
            *displacement = moved + left;
            *slope = cubic_slope(c, zero) * @fit_scale@;
            return 1;
        }
        while (left > 0.5F) {
            centre++;
            moved = moved + 1.0F;
            left = left - 1.0F;
        }
        while (left < -0.5F) {
            if (centre == 0U) {
                return 0;
            }
            centre--;
            moved = moved - 1.0F;
            left = left + 1.0F;
        }
    }
    return 0;
}
";

/// The samples of the smoothed slope that no whole group of four has.
const REST_OF_SLOPE: &str = r"    for (; n < HALF; n++) {
        sums[0] = sums[0] + SLOPE_WEIGHTS[n] * (newest[HALF + 1U + n] - newest[HALF - 1U - n]);
    }
";

const LOGISTIC: &str = r"
/* What the comb gives per rate, and its derivative by the angle. */
static float sensitivity(float angle, float *by_angle)
{
    const float u = angle - @centre@;
    const float left = falling_exp(-size_of(u));
    const float both = 1.0F + left;
    const float half = 0.5F * ((1.0F - left) / both);
    *by_angle = left / (both * both) * @gain@;
    return (u < 0.0F ? -half : half) * @gain@;
}
";

const GAUSSIAN: &str = r"
/* What the comb gives per rate, and its derivative by the angle. */
static float sensitivity(float angle, float *by_angle)
{
    const float u = angle - @centre@;
    const float bell = falling_exp(-(u * u));
    *by_angle = (1.0F - 2.0F * (u * u)) * bell * @gain@;
    return u * bell * @gain@;
}
";

const GATE: &str = r"    if (is_crossing && residual * residual > @nis@ * variance) {
        /* Not believed. */
        return 1;
    }
";

const FILTER: &str = r"
/* The mirror swings freely, which is linear. */
static int predict(@name@_t *filter)
{
    const float p00 = @f00@ * filter->p00 + @f01@ * filter->p10, p01 = @f00@ * filter->p10 + @f01@ * filter->p11;
    const float p10 = @f10@ * filter->p00 + @f11@ * filter->p10, p11 = @f10@ * filter->p10 + @f11@ * filter->p11;
    return take(filter, @f00@ * filter->angle + @f01@ * filter->rate, @f10@ * filter->angle + @f11@ * filter->rate,
                p00 * @f00@ + p01 * @f01@ + @q00@, p10 * @f00@ + p11 * @f01@ + @q10@,
                p10 * @f10@ + p11 * @f11@ + @q11@);
}

/* Corrects by what differs by `residual` from h times the state, with the noise's variance. */
static int correct(@name@_t *filter, float h0, float h1, float residual, float noise, int is_crossing)
{
    const float hp0 = h0 * filter->p00 + h1 * filter->p10, hp1 = h0 * filter->p10 + h1 * filter->p11;
    const float variance = hp0 * h0 + hp1 * h1 + noise;
    const float k0 = hp0 / variance, k1 = hp1 / variance;
    /* What a crossing takes from the covariance, K S K', it gives back as far as the samples are taken. */
    const float added = is_crossing ? noise + @share@ * variance : noise;
    /* Joseph's form: (I - K H) P (I - K H)' + K R K'. */
    const float a00 = 1.0F - k0 * h0, a01 = -(k0 * h1), a10 = -(k1 * h0), a11 = 1.0F - k1 * h1;
    const float b00 = a00 * filter->p00 + a01 * filter->p10, b01 = a00 * filter->p10 + a01 * filter->p11;
    const float b10 = a10 * filter->p00 + a11 * filter->p10, b11 = a10 * filter->p10 + a11 * filter->p11;
    if (!(variance > 0.0F && is_finite(variance) && is_finite(residual))) {
        return 0;
    }
@gate@    return take(filter, filter->angle + k0 * residual, filter->rate + k1 * residual,
                b00 * a00 + b01 * a01 + k0 * k0 * added, b10 * a00 + b11 * a01 + k1 * k0 * added,
                b10 * a10 + b11 * a11 + k1 * k1 * added);
}

/* Corrects by a crossing that is known now, where the signal has a zero there. */
static int cross(@name@_t *filter)
{
    float displacement, slope, rate, noise, h0, h1, t0, t1;
    int k;
    if (!zero_crossing(filter, &displacement, &slope)) {
        return 1;
    }
    /* The angle then, by the state now: the first row of e^(-A t), here by a series in the displacement. */
    h0 = t0 = @back0@;
    h1 = t1 = @back1@;
    for (k = 1; k < 40; k++) {
        const float scale = displacement / (float)k, next0 = scale * (t1 * @a10@);
        t1 = scale * (t0 + t1 * @a11@);
        t0 = next0;
        if (h0 + t0 == h0 && h1 + t1 == h1) {
            break;
        }
        h0 = h0 + t0;
        h1 = h1 + t1;
    }
    /* The rate then makes an error of the time one of the angle. */
    rate = h0 * filter->rate + h1 * (@a10@ * filter->angle + @a11@ * filter->rate);
    /* More by as much as the samples from which it was found correct the filter themselves. */
    noise = @twice@ * (@value_gain@ / (slope * slope) * (rate * rate) + @least@);
    if (!is_finite(noise)) {
        return 1;
    }
    filter->crossings++;
    return correct(filter, h0, h1, @threshold@ - (h0 * filter->angle + h1 * filter->rate), noise, 1);
}

/* What comes behind the prediction. */
static int take_in(@name@_t *filter, float signal_v)
{
    const float signal = signal_v * @UPPER@_PER_VOLT;
    float by_angle, h;
    if (found(filter, signal) && !cross(filter)) {
        return 0;
    }
    h = sensitivity(filter->angle, &by_angle);
    return correct(filter, by_angle * filter->rate, h, signal - (h * filter->rate + @offset@), @variance@, 0);
}

void @name@_start(@name@_t *filter)
{
    unsigned n;
    filter->angle = @angle@;
    filter->rate = @rate@;
    filter->p00 = @p00@;
    filter->p10 = 0.0F;
    filter->p11 = @p11@;
    filter->crossings = 0U;
    for (n = 0; n < 2U * MEMORY; n++) {
        filter->samples[n] = not_a_number();
    }
    filter->oldest = filter->whole = 0U;
    filter->slopes[0] = filter->slopes[1] = not_a_number();
    filter->count = 0U;
    filter->first = filter->filled = 0U;
}

int @name@_begin(@name@_t *filter, float signal_v)
{
    return take_in(filter, signal_v);
}

int @name@_step(@name@_t *filter, float signal_v)
{
    return predict(filter) && take_in(filter, signal_v);
}
";
