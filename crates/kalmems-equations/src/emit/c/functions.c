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
/* --- LN_COSH */
/* ln cosh x */
static float ln_cosh(float x)
{
    const float square = x * x, size = fabsf(x);
    if (square < 0.25F) {
        const float high = (2.5657945e-4F * square - 7.3860296e-4F) * square + 2.1869488e-3F;
        const float series = ((high * square - 6.7460317e-3F) * square + 0.022222222F) * square - 0.083333333F;
        return square * (series * square + 0.5F);
    }
    return (size - 0.693147181F) + logf(1.0F + expf(-2.0F * size));
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
    value = atanhf(z) / z;
    rest = 1.0F / (1.0F - square);
    slope = (rest - value) / z;
    return order == 0U ? value : order == 1U ? slope : 2.0F * (rest * rest - slope / z);
}
/* --- END */
