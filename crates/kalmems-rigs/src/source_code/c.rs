//! The same in C99.

/// A number in f32 as C reads it.
#[allow(clippy::cast_possible_truncation)] // rounding to f32 is what is wanted
pub fn float(value: f64) -> String {
    format!("{:?}F", value as f32)
}

/// The lines of a heading, in a comment.
pub fn comment(heading: &[String]) -> String {
    let lines = heading.iter().map(|line| format!(" * {}\n", line.replace("*/", "* /")));
    lines.collect()
}

/// Header and source by the names that they have; `prefix` is a C name.
pub fn files(prefix: &str, [header, source]: [String; 2]) -> Vec<(String, String)> {
    vec![(format!("{prefix}.h"), header), (format!("{prefix}.c"), source)]
}

/// What a program needs to give samples and to read states, the units of angle, rate and signal and the interval.
pub fn constants(upper: &str, values: [f64; 4]) -> String {
    let known = [
        ("ANGLE_UNIT_RAD", "The unit of the angle in rad."),
        ("RATE_UNIT_RAD_PER_S", "The unit of the rate in rad/s."),
        ("PER_VOLT", "What a signal of 1 V is, in standard deviations of its noise."),
        ("INTERVAL_S", "The sampling interval in s."),
    ];
    let lines = known.into_iter().zip(values).map(|((constant, what), value)| {
        format!("/* {what} */\n#define {upper}_{constant} {}\n", float(value))
    });
    lines.collect()
}

/// What each begins with.
pub const PRELUDE: &str = r#"
#include <stdint.h>

#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0)
#error "gaps and refusals are seen by what is not a number: compile without -ffast-math"
#endif

/* e^x for x <= 0, as in kalmems-core: x = n ln 2 + r, a polynomial in r, and n added to the exponent. */
static float falling_exp(float x)
{
    union { float value; uint32_t bits; } result, count;
    float r, low, square, tail;
    if (!(x > -64.0F)) {
        /* Below 2e-28, and not a number of what is none. */
        return x <= -64.0F ? 0.0F : x;
    }
    count.value = 12582912.0F + x * 1.44269504F;
    r = count.value - 12582912.0F;
    x = x - r * 0.693145752F;
    low = r * -1.42860677e-06F;
    r = x + low;
    square = r * r;
    tail = (0.00138145813F * square + 0.041668389F) * square + 0.49999994F;
    tail = tail + (0.00836872775F * square + 0.166665211F) * r;
    result.value = 1.0F + (x + (low + square * tail));
    result.bits += count.bits << 23;
    return result.value;
}

/* Whether a number is neither infinite nor none. */
static int is_finite(float x)
{
    return x - x == 0.0F;
}

/* Takes over a state if it is one. */
static int take(@name@_t *filter, float angle, float rate, float p00, float p10, float p11)
{
    if (!(is_finite(angle) && is_finite(rate) && is_finite(p00) && is_finite(p10) && is_finite(p11))) {
        return 0;
    }
    filter->angle = angle;
    filter->rate = rate;
    filter->p00 = p00;
    filter->p10 = p10;
    filter->p11 = p11;
    return 1;
}
"#;
