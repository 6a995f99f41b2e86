/* What is kept through a loss of the signal: the filter as it was when its gate opened, which is predicted on. */
typedef struct {
    @name@_state_t state;
    unsigned age;    /* 0 if nothing is kept, or samples since then */
    unsigned agrees; /* samples in a row that it predicts within the bound */
    unsigned alike;  /* samples in a row of which the filter, which takes samples as they are, has moved like it */
    unsigned tries;  /* how often the filter has begun again since then */
} @name@_kept_t;

