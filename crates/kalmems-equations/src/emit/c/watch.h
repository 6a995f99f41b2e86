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

/* How a filter stands to a measurement. */
typedef enum {
    @NAME@_STARTING,      /* it settles: every sample is taken */
    @NAME@_FOLLOWING,     /* the last sample was taken, and samples are as near as the filter says */
    @NAME@_LEFT_OUT,      /* the last sample was not taken: it is missing, or none of the signal */
    @NAME@_OVERCONFIDENT, /* samples are more than twice as far from their predictions as it says: do not trust its variances */
    @NAME@_SIGN_UNSURE,   /* as following, but it has begun again, and the signal is the same for another motion, such as the mirrored one */
    @NAME@_LOST           /* too many samples are none of the signal that it follows: do not trust its means */
} @name@_status_t;

