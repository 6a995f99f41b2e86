
/* Whether too many samples are none of the signal, or something is kept since they were. */
WITHIN int is_open(const @name@_t *filter)
{
    unsigned k, open = filter->kept.age;
    for (k = 0U; k < @NAME@_MEASUREMENTS; k++) {
        open |= filter->watch[k].open;
    }
    return open > 0U;
}

/* Keeps the filter as it was before the correction with which its gate opened. */
static void keep(@name@_t *filter)
{
    unsigned k, opens = 0U;
    for (k = 0U; k < @NAME@_MEASUREMENTS; k++) {
        opens |= @open_of_settled@;
    }
    if (filter->kept.age == 0U && opens > 0U) {
        filter->kept.state = filter->state;
        filter->kept.age = 1U;
        filter->kept.agrees = 0U;
        filter->kept.alike = 0U;
        filter->kept.tries = 0U;
    }
}

/* Whether what is kept is predicted on. */
static int is_kept(const @name@_t *filter)
{
    return filter->kept.age > 0U && filter->kept.age < @longest@U;
}

/* What looks at a sample for the state that is kept: it takes those that follow on some within the bound. */
static @name@_watch_t look_of(const @name@_t *filter)
{
    @name@_watch_t look = FRESH;
    look.seen = @settling@U;
    look.suspect = filter->kept.agrees < @unsuspected@U ? @unsuspected@U : 0U;
    return look;
}

/* Takes notice of what was seen. */
static void looked(@name@_t *filter, const @name@_watch_t *look)
{
    if (look->beyond > 0.0F) {
        filter->kept.agrees = 0U;
    } else if (look->variance > 0.0F) {
        filter->kept.agrees++;
    }
}

/* Whether the means point where those point that are kept: half a cycle apart they point the other way. */
static int is_alike(const @name@_t *filter)
{
    float product = 0.0F, own = 0.0F, kept = 0.0F;
    unsigned k;
    for (k = 0U; k < @NAME@_STATES; k++) {
        const float mean = (float)filter->state.mean[k], other = (float)filter->kept.state.mean[k];
        product += mean * other;
        own += mean * mean;
        kept += other * other;
    }
    return product > 0.0F && product * product > 0.25F * own * kept;
}

/* After a sample with an open gate: the filter goes on from what it has kept if that predicts the signal, and begins again if it is lost. */
static void recover(@name@_t *filter)
{
    unsigned k, most = 0U;
    for (k = 0U; k < @NAME@_MEASUREMENTS; k++) {
        most = filter->watch[k].open > most ? filter->watch[k].open : most;
    }
    if (is_kept(filter)) {
        filter->kept.alike = most == 0U && is_alike(filter) ? filter->kept.alike + 1U : 0U;
        if (filter->kept.agrees >= @agrees@U && is_finite(&filter->kept.state)) {
            filter->state = filter->kept.state;
            for (k = 0U; k < @NAME@_MEASUREMENTS; k++) {
                filter->watch[k] = FRESH;
                filter->watch[k].seen = @settling@U;
            }
            filter->kept.age = 0U;
        } else if (filter->kept.alike >= @agrees@U) {
            filter->kept.age = 0U;
        } else if (most >= @lost@U) {
            restart(filter);
        } else {
            filter->kept.age++;
            filter->begun += is_kept(filter) ? 0U : 1U;
        }
    } else if (most >= @lost@U) {
        restart(filter);
    } else if (most == 0U) {
        filter->kept.age = 0U;
    }
}
