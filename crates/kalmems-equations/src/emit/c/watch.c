
/* The median of chi squared with one degree of freedom. */
#define MEDIAN 0.454936415F

/* Before the first sample. */
static const @name@_watch_t FRESH = {0.0F, 0.0F, 0.0F, 1.0F, MEDIAN, 0.0F, 0U, 0U, 0U, 0U};

/* Takes notice of an innovation in standard deviations of the noise and of its variance; 1 where the sample is taken. */
WITHIN int believed(@name@_watch_t *watch, float residual, float variance)
{
    const float nis = residual * residual / variance;
    const int settles = @settles@;
    /* At the end of the settling time the share is that of its last quarter. */
    const float early = settles ? 4.0F / (4.0F + (float)watch->seen) : 0.0F;
    const float forgets = early > @FORGETS@ ? early : @FORGETS@;
    const float bound = watch->median > MEDIAN ? @LARGEST_NIS@ * (watch->median / MEDIAN) : @LARGEST_NIS@;
    const int beyond = nis > bound;
    const int taken = @taken@;
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
    } else if (settles || (watch->open < 2U && nis <= @LARGEST_NIS@)) {
        watch->open = 1U;
    } else if (nis <= @LARGEST_NIS@) {
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
