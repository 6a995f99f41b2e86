//! The filter of a shared-electrode scanner in C99.

use super::scaled::{Integration, ScaledScannerFilter};
use crate::source_code::c::{self, PRELUDE, comment, constants, float};

/// How a program takes the tables of samples, and how it sees that it takes them rightly.
pub fn use_of_samples(name: &str, integration: Integration) -> Vec<String> {
    let drive = match integration {
        Integration::Euler => "DRIVE_V[k - 1]",
        Integration::RungeKutta => "DRIVE_V[k - 1], MIDDLE_V[k], DRIVE_V[k]",
    };
    vec![
        String::new(),
        format!("{name}_start(&filter); {name}_begin(&filter, SIGNAL_V[0]); and for each k from 1 on:"),
        format!("{name}_step(&filter, {drive}, SIGNAL_V[k]);"),
        format!(
            "Then filter.angle * {}_ANGLE_UNIT_RAD is ANGLE_RAD[k] to 1e-5 of the largest angle.",
            name.to_uppercase()
        ),
        "With a table that is taken one sample off the difference is more than ten times as large."
            .to_owned(),
    ]
}

/// Header and source; `name` begins the names of types and functions and is a C name.
pub fn files(
    (scaled, integration): (&ScaledScannerFilter, Integration),
    (interval_s, update_every): (f64, u32),
    name: &str,
    heading: &[String],
) -> Vec<(String, String)> {
    let (upper, comment) = (name.to_uppercase(), comment(heading));
    let (parameters, arguments, what) = match integration {
        Integration::Euler => ("float drive_v", "drive_v", "at the start of the interval"),
        Integration::RungeKutta => (
            "float start_v, float middle_v, float end_v",
            "start_v, middle_v, end_v",
            "at the start of the interval, in its middle and at its end",
        ),
    };
    let constants = constants(&upper, [scaled.angle_unit, scaled.rate_unit, scaled.per_volt, interval_s]);
    let header = format!(
        r"/*
{comment} */
#ifndef {upper}_H
#define {upper}_H

{constants}/* Every how many samples the filter is corrected. */
#define {upper}_UPDATE_EVERY {update_every}U

/* Mean and covariance of angle and rate, in their units. */
typedef struct {{
    float angle, rate;
    float p00, p10, p11;
    unsigned left; /* samples until the next correction */
}} {name}_t;

/* Before the first sample. */
void {name}_start({name}_t *filter);

/* Corrects by a signal in V. 1 where it was taken; 0 where it is refused and nothing has changed. */
int {name}_update({name}_t *filter, float signal_v);

/* Goes on by one interval, the drive in V {what}. 1 where it was taken; 0 where it is refused and nothing has changed. */
int {name}_predict({name}_t *filter, {parameters});

/* Corrects by the first sample. */
int {name}_begin({name}_t *filter, float signal_v);

/* Both for one sample; between corrections the prediction alone. 1 where what was due was taken. */
int {name}_step({name}_t *filter, {parameters}, float signal_v);

#endif
"
    );
    let predict = match integration {
        Integration::Euler => EULER,
        Integration::RungeKutta => RUNGE_KUTTA,
    };
    let body = [PRELUDE, ACCELERATION, predict, REST]
        .concat()
        .replace("@name@", name)
        .replace("@UPPER@", &upper)
        .replace("@parameters@", parameters)
        .replace("@arguments@", arguments)
        .replace("@carrier@", &float(scaled.carrier_mean_square))
        .replace("@electrodes@", &float(-scaled.pull))
        .replace("@stiffness@", &float(scaled.stiffness))
        .replace("@damping@", &float(scaled.damping))
        .replace("@gain@", &float(scaled.gain))
        .replace("@offset@", &float(scaled.offset))
        .replace("@q00@", &float(scaled.noise[0]))
        .replace("@q10@", &float(scaled.noise[1]))
        .replace("@q11@", &float(scaled.noise[2]))
        .replace("@angle@", &float(scaled.start[0]))
        .replace("@rate@", &float(scaled.start[1]))
        .replace("@p00@", &float(scaled.start_sd[0].powi(2)))
        .replace("@p11@", &float(scaled.start_sd[1].powi(2)));
    c::files(name, [header, format!("/*\n{comment} */\n#include \"{name}.h\"\n{body}")])
}

const ACCELERATION: &str = r"
/* The acceleration, and its derivative by the angle; that by the rate is constant. */
static float acceleration(float angle, float rate, float drive_v, float *by_angle)
{
    const float electrodes = @electrodes@ * (drive_v * drive_v + @carrier@);
    const float overlap = falling_exp(-(angle * angle));
    const float pull = overlap * electrodes - @stiffness@;
    *by_angle = pull - 2.0F * angle * overlap * electrodes * angle;
    return angle * pull - rate * @damping@;
}
";

const EULER: &str = r"
int @name@_predict(@name@_t *filter, float drive_v)
{
    const float f11 = 1.0F - @damping@;
    float f10, angle, rate, p00, p10, p11, fp10, fp11;
    rate = filter->rate + acceleration(filter->angle, filter->rate, drive_v, &f10);
    angle = filter->angle + filter->rate;
    p00 = filter->p00 + filter->p10;
    p10 = filter->p10 + filter->p11;
    fp10 = f10 * filter->p00 + f11 * filter->p10;
    fp11 = f10 * filter->p10 + f11 * filter->p11;
    p00 = p00 + p10 + @q00@;
    p10 = fp10 + fp11 + @q10@;
    p11 = fp10 * f10 + fp11 * f11 + @q11@;
";

const RUNGE_KUTTA: &str = r"
/* One stage: the derivative at x + h k, and its derivatives by x. */
static void stage(const float x[2], float h, const float k[2], const float dk[4], float drive_v, float next[2],
                  float dnext[4])
{
    const float angle = x[0] + h * k[0], rate = x[1] + h * k[1];
    /* The derivatives of this point. */
    const float a00 = 1.0F + h * dk[0], a01 = h * dk[1], a10 = h * dk[2], a11 = 1.0F + h * dk[3];
    float by_angle;
    next[1] = acceleration(angle, rate, drive_v, &by_angle);
    next[0] = rate;
    dnext[0] = a10;
    dnext[1] = a11;
    dnext[2] = by_angle * a00 - @damping@ * a10;
    dnext[3] = by_angle * a01 - @damping@ * a11;
}

int @name@_predict(@name@_t *filter, float start_v, float middle_v, float end_v)
{
    static const float none[4] = {0.0F, 0.0F, 0.0F, 0.0F};
    const float sixth = 1.0F / 6.0F;
    const float x[2] = {filter->angle, filter->rate};
    float k[4][2], dk[4][4], f[4], angle, rate, p00, p10, p11, fp00, fp01, fp10, fp11;
    int i;
    stage(x, 0.0F, none, none, start_v, k[0], dk[0]);
    stage(x, 0.5F, k[0], dk[0], middle_v, k[1], dk[1]);
    stage(x, 0.5F, k[1], dk[1], middle_v, k[2], dk[2]);
    stage(x, 1.0F, k[2], dk[2], end_v, k[3], dk[3]);
    angle = x[0] + (k[0][0] + 2.0F * (k[1][0] + k[2][0]) + k[3][0]) * sixth;
    rate = x[1] + (k[0][1] + 2.0F * (k[1][1] + k[2][1]) + k[3][1]) * sixth;
    for (i = 0; i < 4; i++) {
        f[i] = (dk[0][i] + 2.0F * (dk[1][i] + dk[2][i]) + dk[3][i]) * sixth;
    }
    f[0] += 1.0F;
    f[3] += 1.0F;
    fp00 = f[0] * filter->p00 + f[1] * filter->p10;
    fp01 = f[0] * filter->p10 + f[1] * filter->p11;
    fp10 = f[2] * filter->p00 + f[3] * filter->p10;
    fp11 = f[2] * filter->p10 + f[3] * filter->p11;
    p00 = fp00 * f[0] + fp01 * f[1] + @q00@;
    p10 = fp10 * f[0] + fp11 * f[1] + @q10@;
    p11 = fp10 * f[2] + fp11 * f[3] + @q11@;
";

const REST: &str = r"    return take(filter, angle, rate, p00, p10, p11);
}

int @name@_update(@name@_t *filter, float signal_v)
{
    const float overlap = falling_exp(-(filter->angle * filter->angle));
    const float h = -2.0F * filter->angle * overlap * @gain@;
    const float hp0 = h * filter->p00, hp1 = h * filter->p10;
    const float variance = hp0 * h + 1.0F;
    const float k0 = hp0 / variance, k1 = hp1 / variance;
    const float residual = signal_v * @UPPER@_PER_VOLT - (overlap * @gain@ + @offset@);
    const float angle = filter->angle + k0 * residual, rate = filter->rate + k1 * residual;
    /* Joseph's form: (I - K H) P (I - K H)' + K K'. */
    const float a00 = 1.0F - k0 * h, a10 = -(k1 * h);
    const float b10 = a10 * filter->p00 + filter->p10, b11 = a10 * filter->p10 + filter->p11;
    const float p00 = a00 * (a00 * filter->p00) + k0 * k0;
    const float p10 = a00 * b10 + k1 * k0;
    const float p11 = a10 * b10 + b11 + k1 * k1;
    if (!(variance > 0.0F && is_finite(variance))) {
        return 0;
    }
    return take(filter, angle, rate, p00, p10, p11);
}

void @name@_start(@name@_t *filter)
{
    filter->angle = @angle@;
    filter->rate = @rate@;
    filter->p00 = @p00@;
    filter->p10 = 0.0F;
    filter->p11 = @p11@;
    filter->left = 0U;
}

int @name@_begin(@name@_t *filter, float signal_v)
{
    filter->left = @UPPER@_UPDATE_EVERY - 1U;
    return @name@_update(filter, signal_v);
}

int @name@_step(@name@_t *filter, @parameters@, float signal_v)
{
    if (!@name@_predict(filter, @arguments@)) {
        return 0;
    }
    if (filter->left > 0U) {
        filter->left--;
        return 1;
    }
    filter->left = @UPPER@_UPDATE_EVERY - 1U;
    return @name@_update(filter, signal_v);
}
";
