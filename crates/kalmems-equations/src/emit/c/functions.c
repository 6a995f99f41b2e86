/* --- EXP */
/* e^x: x = n ln 2 + r, a polynomial in r, and n added to the exponent. */
static float exp_f32(float x)
{
    union { float value; uint32_t bits; } count, half;
    float n, high, low, r, square, tail;
    if (!(x > -86.0F)) {
        /* Near the smallest number, and not a number of what is none. */
        return x <= -86.0F ? 0.0F : x;
    }
    if (x > 88.7F) {
        half.bits = 0x7F800000U;
        return half.value;
    }
    count.value = FUSED(x, 1.44269504F, 12582912.0F);
    n = count.value - 12582912.0F;
    high = FUSED(-n, 0.693145752F, x);
    low = n * -1.42860677e-06F;
    r = high + low;
    square = r * r;
    tail = FUSED(FUSED(0.00138145813F, square, 0.041668389F), square, 0.49999994F);
    tail = FUSED(FUSED(0.00836872775F, square, 0.166665211F), r, tail);
    /* In two steps, since 2^n alone may be too large. */
    half.bits = ((count.bits - 1U) << 23) + 0x3F800000U;
    return (1.0F + (high + FUSED(square, tail, low))) * half.value * 2.0F;
}
/* --- FALLING_EXP */
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
/* --- LN */
/* ln x: x = m 2^n with m between sqrt(1/2) and sqrt(2), and a series in (m - 1)/(m + 1). */
static float ln_f32(float x)
{
    union { float value; uint32_t bits; } number;
    float more = 0.0F, n, s, square, series;
    uint32_t shifted;
    if (!(x > 0.0F) || x - x != 0.0F) {
        if (x > 0.0F) {
            return x;
        }
        number.bits = x == 0.0F ? 0xFF800000U : 0x7FC00000U;
        return number.value;
    }
    number.value = x;
    if (x < 1.17549435e-38F) {
        /* A number without a leading one is made larger by 2^24. */
        number.value = x * 16777216.0F;
        more = 24.0F;
    }
    shifted = number.bits - 0x3F3504F3U;
    /* The exponent with its sign, 9 bits of it. */
    n = (float)(int32_t)((shifted >> 23) ^ 0x100U) - 256.0F - more;
    number.bits = (shifted & 0x007FFFFFU) + 0x3F3504F3U;
    s = (number.value - 1.0F) / (number.value + 1.0F);
    square = s * s;
    series = ((0.222222224F * square + 0.285714298F) * square + 0.4F) * square + 0.666666687F;
    return n * 0.693145752F + (n * 1.42860677e-06F + (2.0F * s + s * square * series));
}
/* --- SIN_COS */
/* sin r and cos r for |r| <= pi/4; which quarter of a turn x = quarter pi/2 + r is in. */
static uint32_t reduced(float x, float *sine, float *cosine)
{
    union { float value; uint32_t bits; } count;
    float n, r, square, half, near;
    count.value = 12582912.0F + x * 0.636619747F;
    n = count.value - 12582912.0F;
    r = ((x - n * 1.5703125F) - n * 4.83751297e-4F) - n * 7.54978942e-8F;
    square = r * r;
    *sine = r + r * square * (((2.7557319e-6F * square - 1.984127e-4F) * square + 8.3333333e-3F) * square - 0.166666672F);
    /* What 1 - square/2 loses by rounding is added with the small terms. */
    half = 0.5F * square;
    near = 1.0F - half;
    *cosine = near
              + (((1.0F - near) - half)
                 + square * square * (((-2.7557319e-7F * square + 2.4801587e-5F) * square - 1.3888889e-3F) * square + 0.0416666679F));
    return count.bits & 3U;
}
/* --- SIN */
static float sin_f32(float x)
{
    float sine, cosine;
    const uint32_t quarter = reduced(x, &sine, &cosine);
    const float value = (quarter & 1U) == 0U ? sine : cosine;
    return (quarter & 2U) == 0U ? value : -value;
}
/* --- COS */
static float cos_f32(float x)
{
    float sine, cosine;
    const uint32_t quarter = reduced(x, &sine, &cosine);
    const float value = (quarter & 1U) == 0U ? cosine : sine;
    return quarter == 1U || quarter == 2U ? -value : value;
}
/* --- TANH */
/* tanh x: Lambert's continued fraction near 0, and by e^x elsewhere. */
static float tanh_f32(float x)
{
    const float square = x * x;
    float left, size;
    if (square < 0.4F) {
        const float above = (square + 378.0F) * square + 17325.0F;
        const float below = (28.0F * square + 3150.0F) * square + 62370.0F;
        return x * (above * square + 135135.0F) / (below * square + 135135.0F);
    }
    left = falling_exp(x < 0.0F ? 2.0F * x : -2.0F * x);
    size = (1.0F - left) / (1.0F + left);
    return x < 0.0F ? -size : size;
}
/* --- ATANH */
/* atanh x: a series near 0, and by a logarithm elsewhere. */
static float atanh_f32(float x)
{
    const float square = x * x;
    if (square < 0.09F) {
        const float series = ((0.0769230798F * square + 0.0909090936F) * square + 0.111111112F) * square + 0.142857149F;
        return x + x * square * ((series * square + 0.2F) * square + 0.333333343F);
    }
    return 0.5F * ln_f32((1.0F + x) / (1.0F - x));
}
/* --- SQRT */
/* sqrt x: Heron's method from half the exponent. */
static float sqrt_f32(float x)
{
    union { float value; uint32_t bits; } root;
    float back = 1.0F;
    if (!(x > 0.0F) || x - x != 0.0F) {
        return x < 0.0F ? nothing() : x;
    }
    if (x < 1.17549435e-38F) {
        x *= 16777216.0F;
        back = 1.0F / 4096.0F;
    }
    root.value = x;
    root.bits = (root.bits >> 1) + 0x1FBB4F2EU;
    root.value = 0.5F * (root.value + x / root.value);
    root.value = 0.5F * (root.value + x / root.value);
    root.value = 0.5F * (root.value + x / root.value);
    return root.value * back;
}
/* --- ATAN */
/* atan x: an eighth of a turn or two taken off, and a polynomial in what is left. */
static float atan_f32(float x)
{
    const float size = x < 0.0F ? -x : x;
    float start = 0.0F, t = size, square, series, angle;
    if (size > 2.41421366F) {
        start = 1.57079637F;
        t = -1.0F / size;
    } else if (size > 0.414213568F) {
        start = 0.785398185F;
        t = (size - 1.0F) / (size + 1.0F);
    }
    square = t * t;
    series = (-0.0645192787F * square + 0.107437313F) * square - 0.142639562F;
    series = (series * square + 0.199995399F) * square - 0.333333313F;
    angle = start + (t + t * square * series);
    return x < 0.0F ? -angle : angle;
}
/* --- ASIN */
/* asin x by the arc tangent. */
static float asin_f32(float x)
{
    return atan_f32(x / sqrt_f32((1.0F - x) * (1.0F + x)));
}
/* --- ACOS */
/* acos x by the arc tangent of half of it. */
static float acos_f32(float x)
{
    return 2.0F * atan_f32(sqrt_f32((1.0F - x) / (1.0F + x)));
}
/* --- FLOOR */
/* The largest whole number that is not above x. */
static float floor_f32(float x)
{
    float whole;
    /* Larger numbers are whole, and what is no number stays that. */
    if (!(x > -8388608.0F && x < 8388608.0F)) {
        return x;
    }
    whole = (float)(int32_t)x;
    return whole > x ? whole - 1.0F : whole;
}
/* --- LN_COSH */
/* ln cosh x */
static float ln_cosh(float x)
{
    const float square = x * x, size = x < 0.0F ? -x : x;
    if (square < 0.25F) {
        const float high = (2.5657945e-4F * square - 7.3860296e-4F) * square + 2.1869488e-3F;
        const float series = ((high * square - 6.7460317e-3F) * square + 0.022222222F) * square - 0.083333333F;
        return square * (series * square + 0.5F);
    }
    return (size - 0.693147181F) + ln_f32(1.0F + falling_exp(-2.0F * size));
}
/* --- ATANHC */
/* atanh(z)/z and its first two derivatives. */
static float atanhc(float z, unsigned order)
{
    const float square = z * z;
    float value, rest, slope;
    if (square < 0.25F) {
        /* 1 + z^2/3 + z^4/5 + ..., differentiated term by term. */
        float sum = 0.0F, k = 14.0F;
        int left;
        for (left = 14; left >= 0; left--) {
            const float term = order == 0U   ? 1.0F / (2.0F * k + 1.0F)
                               : order == 1U ? (2.0F * k + 2.0F) / (2.0F * k + 3.0F)
                                             : (2.0F * k + 2.0F) * (2.0F * k + 1.0F) / (2.0F * k + 3.0F);
            sum = sum * square + term;
            k -= 1.0F;
        }
        return order == 1U ? sum * z : sum;
    }
    value = atanh_f32(z) / z;
    rest = 1.0F / (1.0F - square);
    slope = (rest - value) / z;
    return order == 0U ? value : order == 1U ? slope : 2.0F * (rest * rest - slope / z);
}
/* --- END */
