/* What the corrections by a measurement saw. */
typedef struct {
    float residual; /* measured minus predicted, in standard deviations of the noise */
    float variance; /* of that by the filter */
    float nis;      /* the normalised innovation squared; its mean is 1 of a filter that is right */
    float mean_nis; /* the mean of those that were taken last */
    float median;   /* what follows their median; 0.455 of a filter that is right */
    float beyond;   /* the share of the last samples that were beyond the bound */
    unsigned since; /* samples since the last that was taken */
    unsigned seen;  /* samples from the start on, up to the end of the settling time */
    unsigned suspect; /* how suspect the next sample is */
    unsigned open;  /* 0, or, where too many were beyond the bound and all are taken, 1 and how many more were since then than within */
} @name@_watch_t;

/*
 * How a filter stands to a measurement. It is STARTING up to the end of the settling time, where it has one. From then on:
 * - FOLLOWING -> LEFT_OUT: a sample is missing or beyond the bound. LEFT_OUT -> FOLLOWING: a sample is taken.
 * - -> OVERCONFIDENT: the squares of the innovations have a median above four times the expected one; back below that.
 * - -> LOST: an eighth of the last samples were beyond the bound, and all are taken. LOST -> FOLLOWING: less than a sixteenth are, or the state that was
 *   kept from before predicts the signal again. LOST -> STARTING: the filter has begun again as at the start.
 * - FOLLOWING is SIGN_UNSURE once it has lost what it knew of the motion, if another motion has the same signals.
 * Where several hold, the first one of STARTING, LOST, OVERCONFIDENT, SATURATED, LEFT_OUT and SIGN_UNSURE is said.
 */
typedef enum {
    @NAME@_STARTING,      /* it settles: every sample is taken */
    @NAME@_FOLLOWING,     /* the last sample was taken, and samples are as near as the filter says */
    @NAME@_LEFT_OUT,      /* the last sample was not taken: it is missing, or none of the signal */
    @NAME@_OVERCONFIDENT, /* samples are more than twice as far from their predictions as it says: do not trust its variances */
    @NAME@_SIGN_UNSURE,   /* as following, but the signal is the same for another motion, such as the mirrored one, which it may follow */
    @NAME@_LOST,          /* too many samples are none of the signal that it follows: do not trust its means */
    @NAME@_SATURATED      /* the last sample was at an end of the range of its instrument: a gap */
} @name@_status_t;

